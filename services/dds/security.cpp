#include "services/dds/security.hpp"

#include "services/security/identity.hpp"

namespace jostle::dds {

Result<void> secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const std::filesystem::path& folder) {
  const auto identity_result = security::open_identity(folder);
  if (!identity_result) return identity_result.error();
  for (const auto& [name, value] : identity_result->properties) {
    qos.properties().properties().emplace_back(name, value);
  }
  return {};
}

}  // namespace jostle::dds
