#pragma once
/// \file
/// Measuring across hosts: this process on one, its helpers on others.

#include <filesystem>
#include <functional>

#include "services/common/lab/hosts.hpp"
#include "services/studies/bench/benchmarks.hpp"

namespace jostle::studies {

/// A link that is long and bad: 10 ms there and back, one frame in a hundred lost each way.
inline constexpr common::LinkQuality kBadLink{.delay = std::chrono::milliseconds(5), .loss = 0.01, .seed = 1};

/// Runs `measure` on host 1 of so many: all clients, participants and threads that it makes are there.
/// Errors   the measurement's; kUnavailable without the right to make hosts
Result<void> measure_on_hosts(int count, const common::LinkQuality& quality,
                              const std::function<Result<void>(const common::Hosts&)>& measure);

/// Identities `robot` and `worker` of a protected domain, gone at the end of the scope.
class TemporaryKeystore {
 public:
  static Result<TemporaryKeystore> make();
  ~TemporaryKeystore();
  TemporaryKeystore(TemporaryKeystore&& other) noexcept : folder_(std::exchange(other.folder_, {})) {}
  TemporaryKeystore& operator=(TemporaryKeystore&&) = delete;

  const std::filesystem::path& folder() const { return folder_; }

 private:
  explicit TemporaryKeystore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path folder_;
};

}  // namespace jostle::studies
