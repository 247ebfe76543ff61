#include "services/common/lab/cable.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <stop_token>

namespace jostle::common {
namespace {

constexpr std::size_t kLargestFrame = 65'536 + 18;  // of an Ethernet device with any MTU
constexpr int kInARow = 64;                         // frames of one cable before the others get a turn

// The next frame of a device; 0 if there is none.
std::size_t take(int device, std::array<std::uint8_t, kLargestFrame>& buffer) {
  const ssize_t size = read(device, buffer.data(), buffer.size());
  return size > 0 ? static_cast<std::size_t>(size) : 0;
}

// A device that is down, or full, loses the frame; so does a network.
bool give(int device, const std::uint8_t* frame, std::size_t size) { return write(device, frame, size) >= 0; }

}  // namespace

void Cables::add(int host_end, int switch_end) {
  cables_.push_back({.host_end = host_end, .switch_end = switch_end, .losses = Losses(quality_, cables_.size())});
}

void Cables::start() {
  bell_ = eventfd(0, EFD_CLOEXEC);
  carrier_ = std::jthread([this](std::stop_token stop) { carry(stop); });
}

Cables::~Cables() {
  if (carrier_.joinable()) {
    carrier_.request_stop();
    eventfd_write(bell_, 1);
    carrier_.join();
  }
  if (bell_ >= 0) close(bell_);
  for (const Cable& cable : cables_) {
    close(cable.host_end);
    close(cable.switch_end);
  }
}

std::optional<Cables::Clock::time_point> Cables::next_due() const {
  std::optional<Clock::time_point> earliest;
  for (const Cable& cable : cables_) {
    if (cable.under_way.empty()) continue;
    if (!earliest || cable.under_way.front().due < *earliest) earliest = cable.under_way.front().due;
  }
  return earliest;
}

void Cables::carry(std::stop_token stop) {
  std::vector<pollfd> ends{{.fd = bell_, .events = POLLIN, .revents = 0}};
  for (const Cable& cable : cables_) {
    ends.push_back({.fd = cable.host_end, .events = POLLIN, .revents = 0});
    ends.push_back({.fd = cable.switch_end, .events = POLLIN, .revents = 0});
  }
  while (!stop.stop_requested()) {
    timespec pause{};
    const auto due = next_due();
    if (due) {
      const auto left = std::max(*due - Clock::now(), Clock::duration::zero());
      const auto seconds = std::chrono::floor<std::chrono::seconds>(left);
      pause = {.tv_sec = seconds.count(), .tv_nsec = std::chrono::nanoseconds(left - seconds).count()};
    }
    ppoll(ends.data(), ends.size(), due ? &pause : nullptr, nullptr);
    for (Cable& cable : cables_) {
      accept(cable);
      deliver(cable);
      pass(cable);
    }
  }
}

void Cables::accept(Cable& cable) {
  std::array<std::uint8_t, kLargestFrame> buffer;
  for (int i = 0; i < kInARow; ++i) {
    const std::size_t size = take(cable.host_end, buffer);
    if (size == 0) return;
    if (cable.losses.next()) {
      ++lost_;
      continue;
    }
    cable.under_way.push_back({.due = Clock::now() + quality_.delay,
                               .bytes = {buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size)}});
  }
}

void Cables::deliver(Cable& cable) {
  while (!cable.under_way.empty() && cable.under_way.front().due <= Clock::now()) {
    const Frame& frame = cable.under_way.front();
    ++(give(cable.switch_end, frame.bytes.data(), frame.bytes.size()) ? carried_ : lost_);
    cable.under_way.pop_front();
  }
}

void Cables::pass(Cable& cable) {
  std::array<std::uint8_t, kLargestFrame> buffer;
  for (int i = 0; i < kInARow; ++i) {
    const std::size_t size = take(cable.switch_end, buffer);
    if (size == 0) return;
    give(cable.host_end, buffer.data(), size);
  }
}

}  // namespace jostle::common
