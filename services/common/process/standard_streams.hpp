#pragma once
/// \file
/// Standard output and standard error that cannot be written to.

#include <string>

namespace jostle::common {

/// Makes sure for the rest of this process that nothing printed is lost in silence:
///
///   standard output   if it cannot be written to (a full disk, a pipe that was closed), the process is asked to stop
///                     (request_stop()), and in the end says why and exits with kExitBroken, whatever main returns
///   standard error    what cannot be written is dropped; a pipe that was closed asks the process to stop
///
/// Printing never fails and never throws in between. Where a descriptor was closed at the start, no file that is
/// opened later takes its place. Called by parse_arguments(); once is enough.
/// `program`: how the last line begins, such as "jostle bag".
void guard_standard_streams(const std::string& program);

}  // namespace jostle::common
