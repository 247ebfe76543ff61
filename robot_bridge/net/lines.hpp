#pragma once
/// \file
/// A TCP stream cut into lines.

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace jostle::robot_bridge::net {

/// A Lines cuts what comes into lines, however the network merged or split them.
class Lines {
 public:
  static constexpr std::size_t kLongest = 1 << 20;  ///< bytes without an end; more are forgotten

  void append(std::span<const std::uint8_t> bytes) {
    waiting_.append(bytes.begin(), bytes.end());
    if (waiting_.size() > kLongest && waiting_.find('\n') == std::string::npos) waiting_.clear();
  }

  /// Returns how many bytes wait for their end, or to be taken.
  std::size_t waiting() const { return waiting_.size(); }

  /// Returns the next line without its end, "\n" or "\r\n"; nothing while its end is missing.
  std::optional<std::string> next() {
    const auto end = waiting_.find('\n');
    if (end == std::string::npos) return {};
    std::string line = waiting_.substr(0, end);
    waiting_.erase(0, end + 1);
    if (line.ends_with('\r')) line.pop_back();
    return line;
  }

 private:
  std::string waiting_;
};

}  // namespace jostle::robot_bridge::net
