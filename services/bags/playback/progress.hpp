#pragma once
/// \file
/// Progress of a playback as a line of text.

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace jostle::bags {

struct Progress {
  std::string state;                          ///< one word
  double time = 0.0, start = 0.0, end = 0.0;  ///< s after the bag's first message
  double rate = 1.0;
  bool loop = false;
  std::vector<std::pair<std::string, double>> topics;  ///< messages per second, at present
};

/// Writes "[=====>      ]  12.3/60.0 s  x2  playing  loop  230/s  /objects/states 100/s ...": bar, time,
/// rate, state, all messages, and the busiest topics as far as `width` goes.
std::string progress_line(const Progress& progress, std::size_t width);

}  // namespace jostle::bags
