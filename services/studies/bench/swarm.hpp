#pragma once
/// \file
/// Worker processes to be measured, and the pool that uses them.

#include <sched.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "services/common/lab/hosts.hpp"
#include "services/common/process/child_process.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "services/studies/bench/measurement.hpp"

namespace jostle::studies {

/// Where a process lives.
struct Place {
  const common::Hosts* hosts = nullptr;  ///< null: where the caller lives
  int host = 1;
};

/// Programs that lie beside this one, in one DDS domain with it; all of them end
/// with it, and so does the folder of their logs.
class Helpers {
 public:
  /// `core`: the only one they run on, if given.
  Helpers(int domain, std::optional<int> core);
  ~Helpers();
  Helpers(const Helpers&) = delete;
  Helpers& operator=(const Helpers&) = delete;

  /// Adds --domain to the arguments. They are numbered from 0.
  /// Errors   kNotFound naming the program, kIo naming the folder.
  Result<void> start(const std::string& program, std::vector<std::string> arguments, const Place& place = {});

  /// Starts the same program again, in the place of a helper that was killed.
  Result<void> replace(std::size_t helper);

  pid_t pid(std::size_t helper) const { return helpers_.at(helper).process.pid(); }

  /// Names a helper that is gone, with its last words; empty while all are there.
  std::string casualty();

  /// Returns the CPU time that this process and the helpers have used.
  double cpu_seconds() const;

  /// Returns the memory that the helpers have now and share with nobody, bytes.
  double memory() const;

 private:
  struct Helper {
    std::string program;
    std::vector<std::string> arguments;
    Place place;
    std::filesystem::path log;
    common::ChildProcess process;
  };

  Result<common::ChildProcess> spawn(const std::string& program, const std::vector<std::string>& arguments,
                                     const Place& place, const std::filesystem::path& log) const;

  const int domain_;
  const std::optional<int> core_;
  std::filesystem::path folder_;
  std::vector<Helper> helpers_;
};

/// While a Pinned lives, the calling thread, and the threads and processes it starts, run on one core.
class Pinned {
 public:
  explicit Pinned(int core);
  ~Pinned();
  Pinned(const Pinned&) = delete;
  Pinned& operator=(const Pinned&) = delete;

 private:
  cpu_set_t before_;
};

struct SwarmOptions {
  int workers = 1;  ///< processes
  int threads = 1;  ///< of each
  int domain = 0;
  std::optional<int> core;  ///< the only one the workers run on, if given
  std::vector<int> cores;   ///< without `core`: dealt to the workers in turn, each pinned to its own; empty: not pinned
  const common::Hosts* hosts = nullptr;  ///< workers live on hosts 2, 3, … in turn; null: on this one
  std::filesystem::path keystore;  ///< a protected domain's: we are its `robot`, they its `worker`; else JOSTLE_SECURE
  pool::RemotePoolOptions pool;
  std::stop_token stop;
};

/// A Swarm is workers, and a client in the same domain.
class Swarm {
 public:
  /// Returns when all workers can be used.
  /// Errors   kUnavailable  not all of them in time; says how one ended, if it did
  ///          kCancelled    a stop was requested
  static Result<std::unique_ptr<Swarm>> start(const SwarmOptions& options);

  pool::RemotePool& pool() { return pool_; }
  const wire::Participant& participant() const { return participant_; }
  Helpers& helpers() { return helpers_; }
  /// The same turns, in which the workers' CPU time counts as well.
  Turns turns(Turns turns) const {
    turns.cpu_seconds = [this] { return helpers_.cpu_seconds(); };
    return turns;
  }

 private:
  Swarm(const wire::Participant& participant, const SwarmOptions& options);
  Result<void> gather(int workers, std::stop_token stop);

  Helpers helpers_;  // outlives the pool, which would report their end as a loss
  wire::Participant participant_;
  pool::RemotePool pool_;
};

}  // namespace jostle::studies
