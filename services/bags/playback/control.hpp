#pragma once
/// \file
/// What a playback can be told: by other programs, on the command line, by keys.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/playback/playback.hpp"

namespace jostle::bags {

struct Control {
  std::string command;  ///< pause, resume, toggle, step, seek, rate, loop, quit
  double value = 0.0;   ///< for seek (s after the bag's first message), rate, loop (1 or 0)

  bool operator==(const Control&) const = default;
};

/// Reads "pause", "seek:12.5", "rate:2", … Error kInvalidArgument naming what there is.
Result<Control> parse_control(const std::string& text);

/// Does what a control says, except `quit`, which is for the caller to do. Error kInvalidArgument: an unknown command,
/// a value out of range.
Result<void> apply(const Control& control, Playback& playback, TimePoint now);

enum class Key { kSpace, kLeft, kRight, kUp, kDown, kOther };

struct KeyPress {
  Key key = Key::kOther;
  char letter = 0;  ///< what was typed, for kOther

  bool operator==(const KeyPress&) const = default;
};

/// A KeyDecoder turns bytes of a terminal into keys. It skips sequences that it does not know.
class KeyDecoder {
 public:
  std::vector<KeyPress> feed(std::string_view bytes);

 private:
  std::string sequence_;  // begun: ESC and what followed
};

/// What the keys do, for the help and the line below the bar.
inline constexpr const char* kKeyHelp = "space pause  s step  left/right -/+ 5 s  +/- rate  0-9 jump  l loop  q quit";

/// Returns what a key means at this moment; nothing for keys without a meaning.
std::optional<Control> control_of(const KeyPress& press, const Playback& playback, TimePoint now);

/// Converts seconds. Too many for a duration become the longest one that is safe to add to a time.
std::chrono::nanoseconds from_seconds(double seconds);

}  // namespace jostle::bags
