#pragma once
/// \file
/// What the middleware says. For the .cpp files of this room.

namespace jostle::wire {

/// From now on what Fast DDS logs goes where our own lines go, one line per category and second with a count of what
/// was left out, instead of in colours to standard output. Once per process, after profiles were read.
void limit_middleware_log();

}  // namespace jostle::wire
