#pragma once
/// \file
/// The doctor that is asked: `jostle doctor --listen`.

#include <functional>
#include <stop_token>
#include <vector>

#include "services/tools/doctor/check.hpp"
#include "services/tools/doctor/line.hpp"
#include "services/wire/dds/discovery.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::tools {

/// Answers whoever comes to the door, one after the other, until a stop request: says what this machine is and what
/// came through, sends datagrams back to the asker, and repeats samples over DDS.
///
/// `examine` looks at this machine; `notice` hears who came. Throws wire::SetupError.
void listen_to_peers(const wire::Participant& participant, Door door,
                     const std::function<std::vector<Check>()>& examine,
                     const std::function<void(const std::string&)>& notice, std::stop_token stop);

}  // namespace jostle::tools
