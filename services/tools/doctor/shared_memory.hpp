#pragma once
/// \file
/// Fast DDS's shared memory: room for it, and what killed processes left there.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "services/tools/doctor/check.hpp"

namespace jostle::tools {

/// A segment or port of Fast DDS that no living process uses, with its lock
/// files and semaphores.
struct Leftover {
  std::string name;  ///< such as fastrtps_port7400
  std::vector<std::filesystem::path> files;
  std::uintmax_t bytes = 0;
};

struct LeftoverSearch {
  std::filesystem::path folder = "/dev/shm";
  /// Younger files may be half made; a participant makes its files within milliseconds.
  std::chrono::seconds settled{5};
};

/// Looks for segments (fastrtps_…), ports (fastrtps_port…) and data sharing
/// (fast_datasharing_…). Something is in use when a process maps or has open
/// any of its files, or holds a lock on one: locks also show processes in other
/// containers. Files of other users are passed over unless we are root, and so
/// is whatever has not settled.
std::vector<Leftover> find_leftovers(const LeftoverSearch& search = {});

/// Looks for ports of shared memory that this user may not open: another user's, living or left behind.
std::vector<std::string> find_closed_ports(const std::filesystem::path& folder = "/dev/shm");

/// Removes the leftovers that it can remove.
void remove_leftovers(const std::vector<Leftover>& leftovers);

/// Checks that /dev/shm is there, writable, and has room.
Check check_shared_memory();

Check check_leftovers();

}  // namespace jostle::tools
