#pragma once
/// \file
/// DDS Security: a participant that shows who it is and asks others to.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <filesystem>
#include <optional>

#include "idl/types/result.hpp"
#include "services/wire/security/role.hpp"

namespace jostle::wire {

/// Makes participants of this QoS protected, with the identity in `folder`. Errors are those of
/// open_identity(), and kInvalidArgument where the identity's role is not enough for `needed`; the QoS is then as it
/// was.
Result<void> secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const std::filesystem::path& folder,
                    std::optional<Role> needed = {});

}  // namespace jostle::wire
