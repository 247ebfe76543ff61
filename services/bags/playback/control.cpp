#include "services/bags/playback/control.hpp"

#include "idl/types/time.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace jostle::bags {
namespace {

constexpr const char* kCommands = "pause, resume, toggle, step, seek:SECONDS, rate:FACTOR, loop:0, loop:1, quit";
constexpr std::array<std::string_view, 5> kPlain{"pause", "resume", "toggle", "step", "quit"};
constexpr std::array<std::string_view, 3> kWithValue{"seek", "rate", "loop"};

constexpr double kJump = 5.0;  // s
// Rates that + and - go through.
constexpr std::array kLadder{0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0};

Error unknown(const std::string& text) {
  return {Code::kInvalidArgument, fmt::format("control: got '{}', wanted {}", text, kCommands)};
}

double faster(double rate) {
  const auto next = std::ranges::upper_bound(kLadder, rate * 1.001);
  return next == kLadder.end() ? kLadder.back() : *next;
}

double slower(double rate) {
  const auto same = std::ranges::lower_bound(kLadder, rate * 0.999);
  return same == kLadder.begin() ? kLadder.front() : *std::prev(same);
}

}  // namespace

std::chrono::nanoseconds from_seconds(double seconds) {
  constexpr double kMost = 4e9;  // 127 years, from 1970 to beyond today; twice that is no duration too long
  return std::chrono::nanoseconds(std::llround(std::clamp(seconds, -kMost, kMost) * 1e9));
}

Result<Control> parse_control(const std::string& text) {
  const std::size_t colon = text.find(':');
  Control control{.command = text.substr(0, colon)};
  if (colon == std::string::npos) {
    if (std::ranges::count(kPlain, control.command) == 0) return unknown(text);
    return control;
  }
  const char* end = text.data() + text.size();
  const auto [rest, problem] = std::from_chars(text.data() + colon + 1, end, control.value);
  if (std::ranges::count(kWithValue, control.command) == 0 || problem != std::errc() || rest != end)
    return unknown(text);
  return control;
}

Result<void> apply(const Control& control, Playback& playback, TimePoint now) {
  const std::string& command = control.command;
  if (!std::isfinite(control.value)) return unknown(fmt::format("{}:{}", command, control.value));
  if (command == "pause" || (command == "toggle" && !playback.paused())) {
    playback.pause(now);
  } else if (command == "resume" || command == "toggle") {
    playback.resume(now);
  } else if (command == "step") {
    playback.step(now);
  } else if (command == "seek") {
    playback.seek(from_seconds(control.value));
  } else if (command == "rate") {
    return playback.set_rate(control.value, now);
  } else if (command == "loop") {
    playback.set_loop(control.value != 0.0);
  } else {
    return unknown(command);
  }
  return {};
}

std::vector<KeyPress> KeyDecoder::feed(std::string_view bytes) {
  std::vector<KeyPress> presses;
  // An escape key that stood alone at the end of the last read was just that.
  if (sequence_ == "\033" && !bytes.starts_with('[') && !bytes.starts_with('O')) sequence_.clear();
  for (const char byte : bytes) {
    if (byte == '\033') {
      sequence_ = byte;
    } else if (sequence_.empty()) {
      presses.push_back(byte == ' ' ? KeyPress{Key::kSpace} : KeyPress{Key::kOther, byte});
    } else if (sequence_.size() == 1) {
      sequence_ = byte == '[' || byte == 'O' ? sequence_ + byte : "";
    } else if (byte >= '@' && byte <= '~') {  // ends a sequence: ECMA-48, 5.4
      const bool plain = sequence_.size() == 2;
      sequence_.clear();
      if (!plain) continue;
      if (byte == 'A') presses.push_back({Key::kUp});
      if (byte == 'B') presses.push_back({Key::kDown});
      if (byte == 'C') presses.push_back({Key::kRight});
      if (byte == 'D') presses.push_back({Key::kLeft});
    } else {
      sequence_ += byte;
    }
  }
  return presses;
}

std::optional<Control> control_of(const KeyPress& press, const Playback& playback, TimePoint now) {
  const double at = seconds(playback.at(now));
  switch (press.key) {
    case Key::kSpace:
      return Control{"toggle"};
    case Key::kLeft:
      return Control{"seek", at - kJump};
    case Key::kRight:
      return Control{"seek", at + kJump};
    case Key::kUp:
      return Control{"rate", faster(playback.rate())};
    case Key::kDown:
      return Control{"rate", slower(playback.rate())};
    case Key::kOther:
      break;
  }
  if (press.letter >= '0' && press.letter <= '9') {
    const double first = seconds(playback.first()), last = seconds(playback.last());
    return Control{"seek", first + 0.1 * (press.letter - '0') * (last - first)};
  }
  switch (press.letter) {
    case 's':
      return Control{"step"};
    case '+':
    case '=':
      return Control{"rate", faster(playback.rate())};
    case '-':
      return Control{"rate", slower(playback.rate())};
    case 'l':
      return Control{"loop", playback.loops() ? 0.0 : 1.0};
    case 'q':
      return Control{"quit"};
    default:
      return {};
  }
}

}  // namespace jostle::bags
