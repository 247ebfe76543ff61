#pragma once
/// \file
/// DDS Security: a participant that shows who it is and asks others to.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <filesystem>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// Makes participants of this QoS protected, with the identity in `folder`. Errors are those of
/// open_identity(); the QoS is then as it was.
Result<void> secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const std::filesystem::path& folder);

}  // namespace jostle::wire
