#include "services/wire/dds/security.hpp"

#include "services/wire/security/identity.hpp"

namespace jostle::wire {

Result<void> secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const std::filesystem::path& folder) {
  const auto identity_result = open_identity(folder);
  if (!identity_result) return identity_result.error();
  for (const auto& [name, value] : identity_result->properties) {
    qos.properties().properties().emplace_back(name, value);
  }
  return {};
}

}  // namespace jostle::wire
