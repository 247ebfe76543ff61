#pragma once
/// \file
/// What a playback can be told: by other programs, on the command line, by keys.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/play/playback.hpp"

namespace jostle::bags {

struct Control {
  std::string command;  ///< pause, resume, toggle, step, seek, rate, loop, quit
  double value = 0.0;   ///< of seek (s after the bag's first message), rate, loop (1 or 0)

  bool operator==(const Control&) const = default;
};

/// "pause", "seek:12.5", "rate:2", … Error kInvalidArgument naming what there is.
Result<Control> parse_control(const std::string& text);

/// Does it; `quit` is the caller's. Error kInvalidArgument: an unknown command, a value out of range.
Result<void> apply(const Control& control, Playback& playback, TimePoint now);

enum class Key { kSpace, kLeft, kRight, kUp, kDown, kOther };

struct KeyPress {
  Key key = Key::kOther;
  char letter = 0;  ///< of kOther

  bool operator==(const KeyPress&) const = default;
};

/// Bytes of a terminal as keys. Sequences it does not know are no keys.
class KeyDecoder {
 public:
  std::vector<KeyPress> feed(std::string_view bytes);

 private:
  std::string sequence_;  // begun: ESC and what followed
};

/// For the help and the line below the bar.
inline constexpr const char* kKeyHelp = "space pause  s step  left/right -/+ 5 s  +/- rate  0-9 jump  l loop  q quit";

/// What a key means at this moment; nothing for others.
std::optional<Control> control_of(const KeyPress& press, const Playback& playback, TimePoint now);

/// Seconds as a duration; those too many for one become the longest that is safe to add to a time.
std::chrono::nanoseconds from_seconds(double seconds);

}  // namespace jostle::bags
