// What a stranger, or an honest peer that is broken, sends into a domain; and what the programs make of it. Whatever
// comes, a run beside it ends as it would have, nothing grows without bound, and a log stays readable.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <limits>
#include <utility>

#include "services/wire/convert/pool.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/limits.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace jostle_msgs::msg;
using ::testing::HasSubstr;
namespace limits = wire::limits;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// Lines and bytes of a log while a flood lasts.
constexpr std::size_t kFewLines = 200;

std::size_t lines_of(const std::string& text) { return static_cast<std::size_t>(std::ranges::count(text, '\n')); }

class Hostile : public RunFixture {
 protected:
  using Clock = std::chrono::steady_clock;

  Clock::time_point deadline() const { return Clock::now() + kPatience; }

  // What workers say of themselves and of their clients.
  std::optional<WorkerHeartbeat> heard_worker() {
    std::optional<WorkerHeartbeat> heartbeat;
    soon(kPatience, [&] { return (heartbeat = heartbeats.take(Clock::now())).has_value(); });
    return heartbeat;
  }

  // A client other than this process that a worker serves, 0 if none comes.
  std::uint64_t victim() {
    std::uint64_t found = 0;
    soon(kPatience, [&] {
      for (const WorkerHeartbeat& heartbeat : heartbeats.take_all()) {
        for (const ClientLoad& load : heartbeat.clients()) {
          if (load.client() != participant.id()) found = load.client();
        }
      }
      return found != 0;
    });
    return found;
  }

  std::unique_ptr<ProgramProcess> start_worker() {
    auto worker = program("jostle_worker", {});
    EXPECT_TRUE(worker->says("rollouts at a time", kPatience)) << worker->err();
    return worker;
  }

  // A run that plans with the workers there are.
  void expect_a_plan() {
    EXPECT_EQ(finish({easy, "--workers", "0", "--plan-only", "--parameters", plain}), 0) << run->err();
  }

  Assignment assignment(std::uint64_t client, std::uint64_t epoch, std::uint32_t samples) const {
    auto batch = push_batch(scene, samples);
    batch.wait = 1ms;
    Assignment message;
    message.client(client);
    message.epoch(epoch);
    message.batch(wire::to_wire(batch));
    message.best_cost(1e300);
    message.first_success(UINT32_MAX);
    for (std::uint32_t i = 0; i < samples; ++i) message.samples().push_back(i);
    return message;
  }

  const physics_pool::Scene scene = small_scene();
  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  wire::Inbox<WorkerHeartbeat> heartbeats{participant, wire::topics::kPoolWorker, 64};
};

// --- workers and their clients ---------------------------------------------------

TEST_F(Hostile, CancelsInTheNameOfAnotherClientAreNotObeyed) {
  const auto worker = start_worker();
  const auto heartbeat = heard_worker();
  ASSERT_TRUE(heartbeat);
  std::atomic<std::uint64_t> epoch{0}, client{0};
  const wire::Reader<Assignment> spy(participant, wire::topics::pool_assignment(heartbeat->worker()),
                                     [&](const Assignment& seen) {
                                       epoch = seen.epoch();
                                       client = seen.client();
                                     });
  wire::Writer<BatchControl> control(participant, wire::topics::kPoolControl);
  ASSERT_TRUE(control.wait_for_readers(deadline()));
  start({easy, "--workers", "0", "--plan-only", "--parameters", plain});

  EXPECT_TRUE(soon(kPatience, [&] {
    BatchControl cancel;
    cancel.client(client);
    cancel.epoch(epoch);
    return !control.write(cancel) || run->code();
  }));

  EXPECT_EQ(run->code(), 0) << run->err();
  EXPECT_NE(epoch, 0u) << "nothing was there to cancel";
  EXPECT_TRUE(worker->says("wrote it", kPatience)) << worker->err();
  EXPECT_LT(lines_of(worker->err()), kFewLines);
}

TEST_F(Hostile, WorkersThatAreNoneAreIgnored) {
  const auto worker = start_worker();
  wire::Writer<WorkerHeartbeat> writer(participant, wire::topics::kPoolWorker);
  start({easy, "--workers", "0", "--plan-only", "--parameters", plain});
  const std::uint64_t client = victim();
  ASSERT_NE(client, 0u) << run->err();

  std::uint64_t id = 0xabc0'0000'0000'0000;
  soon(kPatience, [&] {
    for (int i = 0; i < 100; ++i) {
      WorkerHeartbeat fake;
      fake.worker(++id);
      fake.name("\x1b[31mred\nline");
      fake.capacity(1'000'000'000);
      fake.clients().emplace_back().client(client);
      fake.clients().back().samples(4'000'000'000u);
      EXPECT_TRUE(writer.write(fake));
    }
    return run->code().has_value();
  });

  EXPECT_EQ(run->code(), 0) << run->err();
}

TEST_F(Hostile, AssignmentsWithoutWorldsFillNoMemory) {
  const auto worker = start_worker();
  const auto heartbeat = heard_worker();
  ASSERT_TRUE(heartbeat);
  const wire::Inbox<AssignmentResults> results(participant, wire::topics::kPoolResult, 1);
  wire::Writer<Assignment> writer(participant, wire::topics::pool_assignment(heartbeat->worker()));
  ASSERT_TRUE(writer.wait_for_readers(deadline()));
  Assignment message = assignment(participant.id(), 1, 4);
  message.batch().draws(std::vector<std::uint32_t>(20'000, 0));

  for (std::uint64_t i = 0; i < 10'000; ++i) {
    message.epoch(i);
    message.batch().world().low(i);
    ASSERT_TRUE(writer.write(message));
  }
  EXPECT_TRUE(writer.wait_until_received(deadline()));

  EXPECT_LT(peak_memory(worker->pid()), 400u);
  EXPECT_TRUE(worker->says("it has too many bytes waiting here", kPatience)) << worker->err();
  EXPECT_LT(lines_of(worker->err()), kFewLines);
  expect_a_plan();
}

TEST_F(Hostile, WorldsOfOneClientFillNoMemoryAndKeepNobodyOut) {
  const auto worker = start_worker();
  wire::Topic<WorldDescription> many = wire::topics::kPoolWorld;
  many.qos.instances = 1'000'000;
  many.qos.kind = {};
  wire::Writer<WorldDescription> writer(participant, many);
  ASSERT_TRUE(writer.wait_for_readers(deadline()));
  const auto announce = [&](const std::string& text) {
    const Hash hash = hash_of(text);
    WorldDescription world;
    world.high(hash.high);
    world.low(hash.low);
    world.scene(text);
    ASSERT_TRUE(writer.write(world));
  };
  for (int i = 0; i < 5000; ++i) announce(fmt::format("# {}\n", i));
  EXPECT_TRUE(writer.wait_until_received(deadline()));
  for (int i = 0; i < 300; ++i) {
    announce(fmt::format("# {}\n{}", i, std::string(limits::kText - 100, 'x')));
    EXPECT_TRUE(writer.wait_until_received(deadline()));
    writer.forget();
  }
  announce(std::string(20 * limits::kText, 'x'));
  EXPECT_TRUE(worker->says("wanted at most", kPatience)) << worker->err();

  EXPECT_LT(peak_memory(worker->pid()), 500u);
  expect_a_plan();
}

TEST_F(Hostile, LiesAboutWorldsAreSaidOnceASecond) {
  const auto worker = start_worker();
  wire::Topic<WorldDescription> many = wire::topics::kPoolWorld;
  many.qos.instances = 1'000'000;
  many.qos.kind = {};
  wire::Writer<WorldDescription> writer(participant, many);
  ASSERT_TRUE(writer.wait_for_readers(deadline()));

  for (std::uint64_t i = 0; i < 3000; ++i) {
    WorldDescription world;
    world.high(i);
    world.scene("a lie");
    ASSERT_TRUE(writer.write(world));
  }
  EXPECT_TRUE(writer.wait_until_received(deadline()));

  EXPECT_TRUE(worker->says("more worlds were refused", kPatience)) << worker->err();
  EXPECT_LT(lines_of(worker->err()), kFewLines);
}

// A worker that gives nothing back: its client hears no more than its heartbeats.
TEST_F(Hostile, BatchOfWhichNothingComesBackSaysSoAndEnds) {
  wire::Writer<WorkerHeartbeat> writer(participant, wire::topics::kPoolWorker);
  const wire::Inbox<Assignment> swallows(participant, wire::topics::pool_assignment(7), 1);
  start({easy, "--workers", "0", "--plan-only", "--parameters", plain});

  wire::Writer<AssignmentResults> results(participant, wire::topics::kPoolResult);
  soon(2 * kPatience, [&] {
    WorkerHeartbeat heartbeat;
    heartbeat.worker(7);
    heartbeat.name("sink");
    heartbeat.capacity(1);
    for (const std::uint64_t client : results.matched_participants()) heartbeat.clients().emplace_back().client(client);
    return !writer.write(heartbeat) || run->code();
  });

  EXPECT_EQ(run->code(), 3) << run->err();
  EXPECT_THAT(run->err(), HasSubstr("no rollout came back for 3 s"));
  EXPECT_THAT(run->err(), HasSubstr("no rollout came back for 20 s and none is under way; usable workers: 1"));
}

// --- goals ------------------------------------------------------------------------

TEST_F(Hostile, GoalsOfGiantTextsAreRefusedBeforeTheyAreParsed) {
  const auto coordinator = program("jostle_coordinator", {"--pool", "threads", "--threads", "1"});
  wire::Writer<Goal> goals(participant, wire::topics::kTaskGoal);
  wire::Inbox<GoalResult> results(participant, wire::topics::kTaskResult, 64);
  ASSERT_TRUE(goals.wait_for_readers(deadline())) << coordinator->err();
  Goal goal;
  goal.goal_id("giant");
  goal.execution_scene(contents(easy));
  goal.planning_scene(contents(easy));
  goal.parameters(std::string(50'000'000, '['));
  goal.controller(std::string(1'000'000, 'c'));

  EXPECT_TRUE(goals.write(goal));

  const auto result = results.take(deadline());
  ASSERT_TRUE(result) << coordinator->err().substr(0, 1000);
  EXPECT_THAT(result->error(), HasSubstr("goal.parameters: got 50000000 bytes, wanted at most 1048576"));
  EXPECT_LT(peak_memory(coordinator->pid()), 1000u);
  EXPECT_LT(coordinator->err().size(), 10'000u);
}

// --- the robot --------------------------------------------------------------------

TEST_F(Hostile, StatusesOfAnotherWorldEndNoRun) {
  wire::Writer<RobotStatus> writer(participant, wire::topics::kRobotStatus);
  wire::Writer<ObjectStates> objects(participant, wire::topics::kObjectStates);
  ASSERT_NO_FATAL_FAILURE(start_acting(2));
  RobotStatus status;
  status.q({0, 0, 0, 0, 0});
  status.v({0, 0, 0, 0, 0});
  soon(kPatience, [&] {
    status.epoch(status.epoch() + 1);
    return !writer.write(status) || !objects.write({}) || run->code();
  });
  EXPECT_EQ(run->code(), 0) << run->err();
}

TEST_F(Hostile, CommandsOfOthersAreSaidOnceASecond) {
  const auto sim = program("jostle_sim", {easy});
  wire::Writer<VelocityCommand> writer(participant, wire::topics::kRobotCommand);
  ASSERT_TRUE(writer.wait_for_readers(deadline())) << sim->err();
  VelocityCommand command;
  command.epoch(1);
  command.velocities({0, 0, 0, 0});
  command.duration(0.01);
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    command.sequence_number(1 + i % 2);  // an older one again and again; the newest may be repeated
    ASSERT_TRUE(writer.write(command));
  }
  command.epoch(UINT64_MAX);
  command.velocities({kNaN, 0, 0, 0});
  for (int i = 0; i < 20'000; ++i) ASSERT_TRUE(writer.write(command));
  EXPECT_TRUE(writer.wait_until_received(deadline()));

  EXPECT_TRUE(sim->says("is stale", kPatience)) << sim->err();
  EXPECT_TRUE(sim->says("of a newcomer", kPatience)) << sim->err();
  sim->signal(SIGTERM);
  EXPECT_EQ(sim->wait(kPatience), 0);
  EXPECT_LT(lines_of(sim->err()), kFewLines);
}

// --- datagrams --------------------------------------------------------------------

// Sends to every port that processes of this domain have.
class Wire {
 public:
  explicit Wire(int domain) : base_(7400 + 250 * domain) {}
  ~Wire() { close(socket_); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  void send(const std::vector<std::uint8_t>& datagram) const {
    std::vector<int> ports{base_};
    for (int process = 0; process < 8; ++process)
      ports.insert(ports.end(), {base_ + 10 + 2 * process, base_ + 11 + 2 * process});
    for (const int port : ports) {
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_port = htons(static_cast<in_port_t>(port));
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      sendto(socket_, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    }
  }

 private:
  const int base_;
  const int socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
};

class Datagrams : public Hostile {
 protected:
  void SetUp() override {
    programs.push_back(program("jostle_worker", {}));
    programs.push_back(program("jostle_coordinator", {"--pool", "threads", "--threads", "1"}));
    programs.push_back(program("jostle_sim", {easy}));
    wire::Writer<Goal> goals(participant, wire::topics::kTaskGoal);
    wire::Writer<VelocityCommand> commands(participant, wire::topics::kRobotCommand);
    ASSERT_TRUE(goals.wait_for_readers(deadline()));
    ASSERT_TRUE(commands.wait_for_readers(deadline()));
    ASSERT_TRUE(heard_worker());
  }

  // They live, rest, and end when they are told to.
  void expect_well() {
    for (const auto& one : programs) {
      EXPECT_FALSE(one->code()) << one->err();
      const double before = processor_time(one->pid());
      const auto start = Clock::now();
      soon(1s, [] { return false; });  // a measurement, not a wait for something
      const std::chrono::duration<double> time = Clock::now() - start;
      EXPECT_LT(processor_time(one->pid()) - before, 0.5 * time.count()) << one->err();
    }
    for (const auto& one : programs) one->signal(SIGTERM);
    for (const auto& one : programs) EXPECT_EQ(one->wait(kPatience), 0) << one->err();
  }

  // The name of a writer of this process, as on the wire.
  wire::Guid own_guid() const {
    std::promise<wire::Guid> guid;
    wire::Writer<Cancel> writer(participant, wire::topics::kTaskCancel);
    const wire::Reader<Cancel> reader(participant, wire::topics::kTaskCancel,
                                      [&, first = true](const Cancel&, const wire::Origin& origin) mutable {
                                        if (origin.participant == participant.id() && std::exchange(first, false))
                                          guid.set_value(origin.writer);
                                      });
    EXPECT_TRUE(soon(kPatience, [&] { return reader.hears(participant.id()) && writer.reaches(participant.id()); }));
    EXPECT_TRUE(writer.write({}));
    return guid.get_future().get();
  }

  const Wire sut{domain};
  std::vector<std::unique_ptr<ProgramProcess>> programs;
};

TEST_F(Datagrams, OfStatisticsThatAreNotTheLastEndNobody) {
  for (const int more : {1, 2, 4}) {
    std::vector<std::uint8_t> datagram{'R', 'T', 'P', 'S', 2, 3, 1, 15};
    datagram.resize(20, 'A');
    datagram.insert(datagram.end(), {0x80, 1, 0x38, 0});
    datagram.resize(datagram.size() + 0x38 + static_cast<std::size_t>(more), 0);
    sut.send(datagram);
  }
  EXPECT_TRUE(programs.front()->says("a statistics submessage is not its last one", kPatience));
  expect_well();
}

// In the name of this process, which they all know: one for each writer that a participant has.
TEST_F(Datagrams, OfAbsurdNumbersHangNobody) {
  wire::Writer<BatchControl> control(participant, wire::topics::kPoolControl);
  wire::Writer<VelocityCommand> command(participant, wire::topics::kRobotCommand);
  ASSERT_TRUE(control.wait_for_readers(deadline()));
  ASSERT_TRUE(command.wait_for_readers(deadline()));
  const wire::Guid self = own_guid();
  for (const std::uint32_t writer : {0x000003c2u, 0x000004c2u, 0x000200c2u, 0x00000103u, 0x00000203u, 0x00000303u}) {
    std::vector<std::uint8_t> datagram{'R', 'T', 'P', 'S', 2, 3, 1, 15};
    datagram.insert(datagram.end(), self.begin(), self.begin() + 12);
    datagram.insert(datagram.end(), {0x07, 0x01, 0x1c, 0x00, 0, 0, 0, 0});
    for (int shift = 24; shift >= 0; shift -= 8) datagram.push_back(static_cast<std::uint8_t>(writer >> shift));
    datagram.insert(datagram.end(), {0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0});  // first 2^40, last 2^40 + 1
    datagram.insert(datagram.end(), {0xff, 0xff, 0xff, 0x7f});
    sut.send(datagram);
  }
  EXPECT_TRUE(programs.front()->says("a sequence number that its writer cannot have reached", kPatience));
  expect_well();
}

}  // namespace
}  // namespace jostle::tests
