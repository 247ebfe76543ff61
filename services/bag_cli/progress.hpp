#pragma once
/// \file
/// How far long work has come, for who watches a terminal.

#include <chrono>
#include <cstdint>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::services {

/// A line on standard error that rewrites itself; nothing where that is no terminal.
class Progress {
 public:
  Progress(std::string what, std::uint64_t total);
  ~Progress();  ///< wipes the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void show(std::uint64_t done);

 private:
  const std::string what_;
  const std::uint64_t total_;
  const bool is_terminal_;
  bool is_shown_ = false;
  std::chrono::steady_clock::time_point next_;
};

/// "jostle bag: …" on standard error; the exit code for it: kExitInterrupted after kCancelled,
/// kExitUsage for what the user named wrongly, else `otherwise`.
int fail(const Error& error, int otherwise);

}  // namespace jostle::services
