#include "services/wire/dds/security.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <string>

#include "services/wire/security/identity.hpp"

namespace jostle::wire {

namespace {

// "jostle run" of jostle_run.
std::string program_name() {
  std::string name = program_invocation_short_name;
  if (const std::size_t first = name.find('_'); first != std::string::npos) name[first] = ' ';
  std::ranges::replace(name, '_', '-');
  return name;
}

}  // namespace

Result<void> secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const std::filesystem::path& folder,
                    std::optional<Role> needed) {
  const auto identity_result = open_identity(folder);
  if (!identity_result) return identity_result.error();
  if (needed && !covers(identity_result->role, *needed)) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: identity '{}' has role {}, `{}` needs {}; remedy: one made by `jostle keys issue "
                             "KEYSTORE NAME --role {}`",
                             folder.string(), identity_result->name, to_string(identity_result->role), program_name(),
                             to_string(*needed), to_string(*needed))};
  }
  for (const auto& [name, value] : identity_result->properties) {
    qos.properties().properties().emplace_back(name, value);
  }
  return {};
}

}  // namespace jostle::wire
