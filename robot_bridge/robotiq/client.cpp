#include "robot_bridge/robotiq/client.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <utility>

namespace jostle::robot_bridge::robotiq {
namespace {

using net::Clock;
using namespace std::chrono_literals;

constexpr auto kAnswer = 1s;
constexpr auto kActivation = 15s;
constexpr auto kPeriod = 15ms;
constexpr auto kRetry = 500ms;

}  // namespace

Client::Client(Options options)
    : options_(std::move(options)), thread_([this](std::stop_token stop) { run(std::move(stop)); }) {}

Client::~Client() = default;

void Client::move(double opening, double speed) {
  const std::lock_guard lock(mutex_);
  wanted_ = opening;
  speed_ = speed;
}

Client::Report Client::report() const {
  const std::lock_guard lock(mutex_);
  return report_;
}

void Client::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    auto tcp_result = net::TcpClient::connect(options_.host, options_.port, Clock::now() + 2s);
    Result<void> ok = tcp_result ? serve(*tcp_result, stop) : Result<void>(tcp_result.error());
    if (stop.stop_requested()) return;
    {
      const std::lock_guard lock(mutex_);
      report_.is_ready = false;
      report_.trouble = "gripper at " + ok.error().message;
      wanted_ = -1.0;
    }
    for (auto end = Clock::now() + kRetry; Clock::now() < end && !stop.stop_requested();)
      std::this_thread::sleep_for(10ms);
  }
}

Result<int> Client::get(net::TcpClient& tcp, const char* variable) {
  if (auto ok = tcp.write(get_request(variable), Clock::now() + kAnswer); !ok) return ok.error();
  auto line_result = tcp.read_line(Clock::now() + kAnswer);
  if (!line_result) return line_result.error();
  const auto value = read_answer(variable, *line_result);
  if (value) return *value;
  return Error{Code::kInvalidArgument,
               fmt::format("{}: asked for {}, got '{}'", tcp.place(), variable, line_result->substr(0, 80))};
}

// The answer to SET has no end of line.
Result<void> Client::set(net::TcpClient& tcp, const std::string& request) {
  const auto deadline = Clock::now() + kAnswer;
  if (auto ok = tcp.write(request, deadline); !ok) return ok;
  std::string answer;
  std::array<std::uint8_t, 3> room;
  while (answer.size() < 3) {
    auto bytes_result = tcp.read(std::span(room).first(3 - answer.size()), deadline);
    if (!bytes_result) return bytes_result.error();
    answer.append(bytes_result->begin(), bytes_result->end());
  }
  if (answer == "ack") return {};
  return Error{Code::kInvalidArgument,
               fmt::format("{}: it did not take '{}'", tcp.place(), request.substr(0, request.size() - 1))};
}

Result<void> Client::serve(net::TcpClient& tcp, std::stop_token stop) {
  auto status_result = get(tcp, "STA");
  if (!status_result) return status_result.error();
  if (*status_result != static_cast<int>(Status::kActive)) {
    for (const char* request : {"SET ACT 0\n", "SET ATR 0\n", "SET ACT 1\n"}) {
      if (auto ok = set(tcp, request); !ok) return ok;
    }
    const auto deadline = Clock::now() + kActivation;
    do {
      std::this_thread::sleep_for(kPeriod);
      status_result = get(tcp, "STA");
      if (!status_result) return status_result.error();
      if (stop.stop_requested()) return {};
      if (Clock::now() > deadline) return Error{Code::kDeadline, tcp.place() + ": the activation took too long"};
    } while (*status_result != static_cast<int>(Status::kActive));
  }
  int sent = -1;
  double before = 0.0;
  auto read_at = Clock::now() - 1s;
  while (!stop.stop_requested()) {
    double wanted = 0.0, speed = 0.0;
    {
      const std::lock_guard lock(mutex_);
      wanted = wanted_;
      speed = speed_;
    }
    if (wanted >= 0.0 && position_of(wanted) != sent) {
      sent = position_of(wanted);
      if (auto ok = set(tcp, move_request(sent, speed_count(speed), options_.force)); !ok) return ok;
    }
    auto position_result = get(tcp, "POS"), object_result = get(tcp, "OBJ"), fault_result = get(tcp, "FLT");
    for (const auto* result : {&position_result, &object_result, &fault_result}) {
      if (!*result) return result->error();
    }
    const auto now = Clock::now();
    const std::chrono::duration<double> passed = now - std::exchange(read_at, now);
    const double opening = opening_of(*position_result);
    {
      const std::lock_guard lock(mutex_);
      report_.is_ready = *fault_result == 0;
      report_.trouble = *fault_result == 0 ? "" : fmt::format("gripper: {}", fault_text(*fault_result));
      report_.velocity = passed.count() < 0.5 ? (opening - before) / passed.count() : 0.0;
      report_.opening = opening;
      report_.object = static_cast<Object>(*object_result);
    }
    before = opening;
    std::this_thread::sleep_for(kPeriod);
  }
  return {};
}

}  // namespace jostle::robot_bridge::robotiq
