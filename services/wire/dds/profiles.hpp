#pragma once
/// \file
/// The file of transports and QoS: what it says is in force instead of what the code says.

#include <cstdint>
#include <filesystem>

#include "idl/types/result.hpp"

namespace jostle::wire {

struct ProfilesFile {
  std::filesystem::path path;  ///< empty: there is none
  bool shared = false;         ///< whether other programs of Fast DDS use it: profiles of other names are theirs
};

/// Returns the file in force: JOSTLE_PROFILES, else FASTRTPS_DEFAULT_PROFILES_FILE, else profiles.xml in the
/// share folder of this program (deploy/profiles.xml, which is /etc/jostle/profiles.xml once installed).
ProfilesFile profiles_file();

/// Gives the middleware the profiles of this file, and no others:
///
///   participant                udp, shared_memory, or any name that JOSTLE_DDS_TRANSPORT gives
///   data_writer, data_reader   a kind of topic (qos.hpp), or one topic's name on the wire
///
/// Threads  one at a time, and no participant is being made meanwhile.
/// Errors   kNotFound         the file is missing, or cannot be read
///          kInvalidArgument  says the line, what is there and what was wanted: what Fast DDS does not take,
///                            names that nothing asks for, promises that writers and readers cannot keep
Result<void> load_profiles(const ProfilesFile& file);

/// Returns the bytes of buffer that sockets of the profile udp ask the kernel for, with the profiles loaded.
std::uint32_t socket_buffer();

}  // namespace jostle::wire
