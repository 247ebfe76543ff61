#include "services/studies/bench/echo.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "services/common/process/program.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/workload.hpp"
#include "services/wire/convert/pool.hpp"

namespace jostle::studies {
namespace {

namespace msg = jostle_msgs::msg;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kMeeting{15};  // until both processes know each other
constexpr std::chrono::milliseconds kGreeting{100};
constexpr std::size_t kUnread = 1024;  // answers; windows are smaller

// Type and promise of the pool's own, and nobody else's name.
const wire::Topic<msg::Assignment> kPing{"rt/bench/ping", kTask};
const wire::Topic<msg::AssignmentResults> kPong{"rt/bench/pong", kTask};

}  // namespace

void Trips::add(Clock::time_point start) { all_.push_back(1e6 * seconds_since(start)); }

Sample Trips::finish(const Hash& hash) {
  const std::vector<double> newest(all_.begin() + static_cast<std::ptrdiff_t>(first_), all_.end());
  first_ = all_.size();
  return {.value = common::median(newest), .hash = hash};
}

Echo::Echo(const wire::Participant& participant) : ping_(participant, kPing), pong_(participant, kPong, kUnread) {}

Result<void> Echo::meet(Assignment assignment, Helpers& helpers) {
  const auto deadline = Clock::now() + kMeeting;
  do {
    assignment.epoch(++epoch_);
    (void)ping_.write(assignment);  // greeted again until somebody answers
    if (pong_.take(Clock::now() + kGreeting)) return {};
  } while (Clock::now() < deadline);
  return Error{Code::kUnavailable, fmt::format("echo: no answer in {} s {}", kMeeting.count(), helpers.casualty())};
}

// Answers to greetings may come late; they are not meant.
Result<Echo::Answer> Echo::answer_since(std::uint64_t epoch) {
  const auto deadline = Clock::now() + kLost;
  auto answer = pong_.take(deadline);
  while (answer && answer->results().front().epoch() < epoch) answer = pong_.take(deadline);
  if (answer) return std::move(answer->results().front());
  return Error{Code::kUnavailable, fmt::format("echo: no answer to ping {} in {} s", epoch, kLost.count())};
}

Result<Echo::Answer> Echo::ask(Assignment& assignment) {
  assignment.epoch(++epoch_);
  (void)ping_.write(assignment);  // a lost one is an answer that does not come
  return answer_since(epoch_);
}

Result<void> Echo::stream(Assignment& assignment, int count, int window) {
  const std::uint64_t first = epoch_ + 1;
  int answered = 0;
  for (int sent = 0; answered < count; ++answered) {
    for (; sent < count && sent - answered < window; ++sent) {
      assignment.epoch(++epoch_);
      (void)ping_.write(assignment);  // likewise
    }
    if (auto answer = answer_since(first); !answer) return answer.error();
  }
  return {};
}

msg::Assignment assignment_of(const physics_pool::RolloutBatch& batch) {
  msg::Assignment assignment;
  assignment.batch(wire::to_wire(batch));
  assignment.best_cost(physics_pool::kInfinity);
  assignment.first_success(UINT32_MAX);
  assignment.samples({batch.first_sample});
  return assignment;
}

physics_pool::RolloutOutcome empty_outcome(std::uint32_t sample) {
  return {.sample = sample, .end = physics_pool::End::kCompleted, .cost = 0.0};
}

int serve_echo(int domain, std::stop_token stop) {
  common::die_with_parent(getppid());
  auto participant_result = wire::Participant::open({.name = "jostle_bench_echo", .domain = domain});
  if (!participant_result) {
    fmt::print(stderr, "jostle bench: {}\n", participant_result.error().message);
    return common::kExitBroken;
  }
  wire::Writer<msg::AssignmentResults> pong(*participant_result, kPong);
  const wire::Reader<msg::Assignment> ping(*participant_result, kPing, [&](const msg::Assignment& assignment) {
    msg::AssignmentResult result = wire::to_wire(empty_outcome(assignment.samples().front()));
    result.epoch(assignment.epoch());
    if (assignment.batch().want_all_trajectories()) result.trajectory(assignment.batch().nominal());
    msg::AssignmentResults answer;
    answer.client(assignment.client());
    answer.results().push_back(std::move(result));
    (void)pong.write(answer);  // likewise, at the asker's
  });
  common::wait_for(std::move(stop));
  return common::kExitOk;
}

}  // namespace jostle::studies
