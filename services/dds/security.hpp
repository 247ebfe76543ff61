#pragma once
/// \file
/// DDS Security: a participant that shows who it is and asks others to.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <filesystem>

#include "idl/types/result.hpp"

namespace jostle::dds {

/// Makes participants of this QoS protected, as the identity in that folder. Errors of
/// security::open_identity(); the QoS is then as it was.
Result<void> secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const std::filesystem::path& folder);

}  // namespace jostle::dds
