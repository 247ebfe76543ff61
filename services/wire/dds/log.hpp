#pragma once
/// \file
/// What the middleware says.

namespace jostle::wire {

/// Sends the middleware's lines to standard error as our own are: the program's name before them, no colours. It would
/// colour them in files, too, and say some on standard output.
void log_in_plain_lines();

}  // namespace jostle::wire
