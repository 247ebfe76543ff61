// What a worker makes of messages that no honest client would send.

#include <gmock/gmock.h>

#include <array>

#include "services/pool/client/remote_pool.hpp"
#include "services/wire/convert/pool.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/cramped_writer.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace jostle_msgs::msg;
using physics_pool::Scene;
using ::testing::HasSubstr;

constexpr auto kPatience = 60s;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A client made by hand, and one worker.
class PoolWire : public ::testing::Test {
 protected:
  PoolWire() {
    worker_id = hear_worker();
    assignments = std::make_unique<wire::Writer<Assignment>>(participant, wire::topics::pool_assignment(worker_id));
    EXPECT_TRUE(assignments->wait_for_readers(in(kPatience)));
    announce(physics_pool::scene_hash(scene), physics_pool::to_yaml(scene));
  }

  // Waits until the worker hears us too, and gives its id.
  std::uint64_t hear_worker() {
    while (auto heartbeat = heartbeats.take(in(kPatience))) {
      for (const ClientLoad& client : heartbeat->clients()) {
        if (client.client() == participant.id()) return heartbeat->worker();
      }
    }
    throw std::runtime_error("the worker was not heard");
  }

  void announce(const Hash& hash, const std::string& text) {
    WorldDescription description;
    description.high(hash.high);
    description.low(hash.low);
    description.scene(text);
    EXPECT_TRUE(worlds.write(description));
  }

  Assignment good_assignment() {
    Assignment assignment;
    assignment.client(participant.id());
    assignment.epoch(++epoch);
    assignment.batch(wire::to_wire(push_batch(scene, 2)));
    assignment.best_cost(physics_pool::kInfinity);
    assignment.first_success(UINT32_MAX);
    assignment.samples({0, 1});
    return assignment;
  }

  // The first answer to an assignment; an empty one if none comes.
  AssignmentResult ask(const Assignment& assignment) {
    EXPECT_TRUE(assignments->write(assignment));
    while (auto answer = results.take(in(kPatience))) {
      EXPECT_EQ(answer->worker(), worker_id);
      for (const AssignmentResult& result : answer->results()) {
        if (result.epoch() == assignment.epoch()) return result;
      }
    }
    ADD_FAILURE() << "no answer";
    return {};
  }

  void expect_still_serves() {
    const AssignmentResult result = ask(good_assignment());
    EXPECT_EQ(result.error(), "");
    EXPECT_EQ(result.steps(), 3u);
  }

  const int domain = test_domain();
  const Scene scene = small_scene();
  const WorkerProcess worker{domain};
  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  wire::Inbox<WorkerHeartbeat> heartbeats{participant, wire::topics::kPoolWorker, 10};
  wire::Inbox<AssignmentResults> results{participant, wire::topics::kPoolResult, 100};
  wire::Writer<WorldDescription> worlds{participant, wire::topics::kPoolWorld};
  wire::Writer<BatchControl> controls{participant, wire::topics::kPoolControl};
  std::unique_ptr<wire::Writer<Assignment>> assignments;
  std::uint64_t worker_id = 0;
  std::uint64_t epoch = 0;
};

TEST_F(PoolWire, MalformedAssignmentIsAnsweredWithTheFieldsName) {
  const std::pair<const char*, std::function<void(Assignment&)>> cases[] = {
      {"x0.q[0]", [](Assignment& t) { t.batch().q()[0] = kNaN; }},
      {"x0.v", [](Assignment& t) { t.batch().v().resize(3); }},
      {"x0", [](Assignment& t) { t.batch().q().resize(200'000); }},
      {"nominal.nu", [](Assignment& t) { t.batch().nu(-7); }},
      {"nominal.nu", [](Assignment& t) { t.batch().nu(2'000'000'000); }},
      {"nominal.values", [](Assignment& t) { t.batch().nominal().resize(4 * 20'000); }},
      {"nominal.values", [](Assignment& t) { t.batch().nominal().resize(5); }},
      {"u_before", [](Assignment& t) { t.batch().u_before().clear(); }},
      {"step_duration", [](Assignment& t) { t.batch().step_duration(1e300); }},
      {"step_duration", [](Assignment& t) { t.batch().step_duration(-1); }},
      {"law.sigma", [](Assignment& t) { t.batch().sigma().clear(); }},
      {"law.limit[3]", [](Assignment& t) { t.batch().limit()[3] = kNaN; }},
      {"samples", [](Assignment& t) { t.batch().samples(1'000'000'000); }},
      {"first_sample", [](Assignment& t) { t.batch().first_sample(UINT32_MAX); }},
      {"min_steps", [](Assignment& t) { t.batch().min_steps(-1); }},
      {"incumbent", [](Assignment& t) { t.batch().incumbent(kNaN); }},
      {"objective.acceleration", [](Assignment& t) { t.batch().terms()[0].weight(kNaN); }},
      {"objective.acceleration", [](Assignment& t) { t.batch().terms()[0].values({1.0}); }},
      {"objective.acceleration", [](Assignment& t) { t.batch().terms()[1] = t.batch().terms()[0]; }},
      {"objective.terms", [](Assignment& t) { t.batch().terms()[0].kind("charm"); }},
      {"objective.success_cost", [](Assignment& t) { t.batch().success_cost(-1); }},
      {"wait", [](Assignment& t) { t.batch().wait(INT64_MAX); }},
      {"wait", [](Assignment& t) { t.batch().wait(-2); }},
      {"priority", [](Assignment& t) { t.batch().priority(2); }},
      {"assignment.samples", [](Assignment& t) { t.samples({}); }},
      {"assignment.samples",
       [](Assignment& t) {
         t.samples({0, 7});
       }},
      {"assignment.samples", [](Assignment& t) { t.samples(std::vector<std::uint32_t>(100'000, 0)); }},
      {"assignment.best_cost", [](Assignment& t) { t.best_cost(kNaN); }},
  };
  for (const auto& [field, spoil] : cases) {
    Assignment assignment = good_assignment();
    spoil(assignment);
    const AssignmentResult result = ask(assignment);
    EXPECT_THAT(result.error(), HasSubstr(std::string(field) + ": got"));
    EXPECT_EQ(result.error_code(), static_cast<int>(Code::kInvalidArgument)) << field;
  }
  expect_still_serves();
}

TEST_F(PoolWire, WorldWhoseHashLiesIsRefused) {
  const Hash claimed{.high = 1, .low = 2};
  announce(claimed, physics_pool::to_yaml(scene));
  Assignment assignment = good_assignment();
  assignment.batch().world(wire::to_wire(claimed));

  const AssignmentResult result = ask(assignment);

  EXPECT_THAT(result.error(), HasSubstr(to_string(claimed)));
  EXPECT_THAT(result.error(), HasSubstr(to_string(physics_pool::scene_hash(scene))));
  expect_still_serves();
}

TEST_F(PoolWire, LieAboutAKnownWorldChangesNothing) {
  expect_still_serves();
  announce(physics_pool::scene_hash(scene), "nonsense");
  expect_still_serves();
}

TEST_F(PoolWire, WorldThatIsNoSceneIsRefused) {
  for (const std::string text : {"", "[", "jostle_scene: 1\n", "{a: &x [*x]}"}) {
    announce(hash_of(text), text);
    Assignment assignment = good_assignment();
    assignment.batch().world(wire::to_wire(hash_of(text)));
    EXPECT_THAT(ask(assignment).error(), HasSubstr(to_string(hash_of(text)))) << text;
  }
  expect_still_serves();
}

TEST_F(PoolWire, AssignmentWaitsForItsWorld) {
  const Scene late = small_scene(2);
  Assignment assignment = good_assignment();
  assignment.batch(wire::to_wire(push_batch(late, 2)));
  EXPECT_TRUE(assignments->write(assignment));
  expect_still_serves();  // an assignment that waits holds up no other

  announce(physics_pool::scene_hash(late), physics_pool::to_yaml(late));

  const auto answer = results.take(in(kPatience));  // of this assignment or the second sample above
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->results().front().error(), "");
  EXPECT_TRUE(eventually(in(kPatience), [&] {
    const auto next = results.take(in(1s));
    return next && next->results().back().epoch() == assignment.epoch() && next->results().back().error().empty();
  }));
}

TEST_F(PoolWire, WorldThatNeverComesIsAnErrorAfterAWhile) {
  Assignment assignment = good_assignment();
  assignment.batch().world(wire::to_wire(Hash{.high = 0xfeed, .low = 0xbeef}));

  const AssignmentResult result = ask(assignment);

  EXPECT_EQ(result.error_code(), static_cast<int>(Code::kUnknownWorld));
  EXPECT_THAT(result.error(), HasSubstr("000000000000feed000000000000beef"));
  expect_still_serves();
}

TEST_F(PoolWire, NonsenseNewsOfABatchAreIgnored) {
  BatchControl control;
  control.client(participant.id());
  for (const int kind : {0, 1, 2, 3, 255}) {
    control.kind(static_cast<std::uint8_t>(kind));
    control.cost(kNaN);
    control.epoch(12345);
    EXPECT_TRUE(controls.write(control));
  }
  expect_still_serves();
}

TEST_F(PoolWire, AssignmentsBeyondWhatAWorkerKeepsAreCountedInItsHeartbeat) {
  Assignment assignment = good_assignment();
  assignment.batch().world(wire::to_wire(Hash{.high = 0xfeed, .low = 0xbeef}));  // they wait for it, 5 s
  const auto refused = [&] {
    const auto heartbeat = heartbeats.take(in(kPatience));
    return heartbeat ? heartbeat->refused() : 0;
  };
  EXPECT_EQ(refused(), 0u);

  const auto deadline = in(kPatience);
  while (refused() == 0 && Clock::now() < deadline) {
    for (int i = 0; i < 400; ++i) EXPECT_TRUE(assignments->write(assignment));
  }

  const std::uint64_t count = refused();
  EXPECT_GT(count, 0u);
  EXPECT_GE(refused(), count) << "it counts from the start";
}

TEST(WorkerThatCannotAnswer, SaysSoAndLivesOn) {
  const TempFolder folder;
  std::string profiles = contents(JOSTLE_PROGRAMS "/../share/jostle/profiles.xml");
  profiles.insert(profiles.find("</profiles>"), cramped_writer(wire::topics::kPoolResult.name));
  const std::string file = folder.write("profiles.xml", profiles);
  const int domain = test_domain();
  ProgramProcess worker("jostle_worker", {"--domain", std::to_string(domain)}, folder, {{"JOSTLE_PROFILES", file}});
  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  pool::RemotePool sut(participant);
  const Scene scene = small_scene();
  ASSERT_TRUE(sut.load(scene));
  ASSERT_TRUE(sut.wait_for_workers(1, in(kPatience))) << worker.err();
  physics_pool::RolloutBatch batch = push_batch(scene, 1);
  batch.step_duration = 0.01;
  for (int t = 0; t < 1500; ++t) batch.nominal.append(std::array{0.0, 0.0, 0.0, 0.0});
  batch.want_all_trajectories = true;  // an answer of 540 kB, where the middleware expects 100 results of a few kB
  const auto ticket_result = sut.submit(batch, [](const auto&) {});
  ASSERT_TRUE(ticket_result);

  EXPECT_TRUE(worker.says("a result was not taken by the middleware", kPatience)) << worker.err();

  // The client has it run again and again; other batches are served beside it.
  const auto small = sut.run(wait_batch(scene, 2, 0ns), in(kPatience));
  ASSERT_TRUE(small) << small.error().message;
  EXPECT_EQ((*ticket_result)->missing(), 1u);
}

}  // namespace
}  // namespace jostle::tests
