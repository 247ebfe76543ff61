// Bad files, bad arguments and bad messages, given to a run.

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmath>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

class BadInput : public RunFixture {
 protected:
  // The run refuses, without starting anything, in words that hold all of these.
  void expect_refused(const std::vector<std::string>& arguments, const std::vector<std::string>& words) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    EXPECT_EQ(finish(arguments), 2);
    for (const std::string& word : words) EXPECT_THAT(run->err(), HasSubstr(word));
    EXPECT_THAT(run_folders(), IsEmpty());
  }

  std::string scene_file(const std::function<void(physics_pool::Scene&)>& spoil) {
    physics_pool::Scene scene = three_objects();
    spoil(scene);
    return folder.write("spoilt.yaml", physics_pool::to_yaml(scene));
  }
};

TEST_F(BadInput, SceneThatIsNoneIsRefusedWithFileFieldGotAndWanted) {
  const std::string missing = folder.path() / "missing.yaml";
  expect_refused({missing}, {missing});
  const std::string broken = folder.write("broken.yaml", "jostle_scene: [1, 2\n");
  expect_refused({broken}, {broken + ":", "YAML"});
  const std::string other = folder.write("other.yaml", "fruit: apple\n");
  expect_refused({other}, {other + ":", "wanted"});
  const std::string empty = folder.write("empty.yaml", "");
  expect_refused({empty}, {empty, "wanted"});
}

TEST_F(BadInput, SceneThatCannotBeIsRefusedWithFileFieldGotAndWanted) {
  const std::string spoilt = folder.path() / "spoilt.yaml";
  using physics_pool::Scene;
  expect_refused({scene_file([](Scene& s) {
                   s.objects[1].x = s.objects[0].x;
                   s.objects[1].y = s.objects[0].y;
                 })},
                 {spoilt, "objects[1]", "target", "can"});
  expect_refused({scene_file([](Scene& s) { s.robot.model.joints[0].gain = -1; })},
                 {spoilt, "robot.joints[0] ('gripper_x').gain", "got -1", "wanted"});
  expect_refused({scene_file([](Scene& s) { s.objects[2].mass = -0.5; })},
                 {spoilt, "objects[2]", "mass", "got -0.5", "wanted"});
  expect_refused({scene_file([](Scene& s) { s.objects[2].x = kNaN; })}, {spoilt, "objects[2]", "got", "wanted"});
  expect_refused({scene_file([](Scene& s) { s.task.target = "grail"; })},
                 {spoilt, "task.target", "got 'grail'", "wanted"});
  expect_refused({scene_file([](Scene& s) { s.objects[2].name = "can"; })}, {spoilt, "objects[2]", "'can'"});
}

TEST_F(BadInput, SceneToolEndsWithTwoOnABadFileAndWithThreeWhenItCannotWrite) {
  const std::string broken = folder.write("broken.yaml", "jostle_scene: [1, 2\n");
  for (const std::string& file : {broken, (folder.path() / "missing.yaml").string()}) {
    for (const char* command : {"check", "show", "perturb"}) {
      const auto tool = program("jostle_scene", {command, file});
      EXPECT_EQ(tool->wait(kPatience), 2) << command;
      EXPECT_THAT(tool->err(), HasSubstr(file));
      EXPECT_EQ(tool->out(), "");
    }
  }
  const auto crowd = program("jostle_scene", {"generate", "--objects", "4000"});
  EXPECT_EQ(crowd->wait(kPatience), 2);
  const auto unwritable = program("jostle_scene", {"generate", "-o", broken + "/scene.yaml"});
  EXPECT_EQ(unwritable->wait(kPatience), 3);
  EXPECT_THAT(unwritable->err(), HasSubstr("is not a folder"));
  const auto good = program("jostle_scene", {"show", easy});
  EXPECT_EQ(good->wait(kPatience), 0);
  EXPECT_THAT(good->out(), HasSubstr("name             shape"));
}

// As happens beyond domain 100, where Linux gives the ports to any program that wants some port.
TEST_F(BadInput, DomainWhosePortOfDiscoveryIsTakenIsRefusedWithPortAndRemedy) {
  const int port = 7400 + 250 * domain;
  const int taker = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<in_port_t>(port));
  ASSERT_EQ(bind(taker, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);

  EXPECT_EQ(finish({easy}), 3);

  close(taker);
  for (const std::string& word :
       {"domain " + std::to_string(domain), std::to_string(port), std::string("ROS_DOMAIN_ID")}) {
    EXPECT_THAT(run->err(), HasSubstr(word));
  }
  EXPECT_THAT(run_folders(), IsEmpty());
}

TEST_F(BadInput, ArgumentsAreRefusedWithGotAndWanted) {
  expect_refused({easy, "--controller", "psychic"}, {"controller", "psychic", "or", "nr"});
  expect_refused({easy, "--controller", "mpc"},
                 {"--controller", "got 'mpc' for a task to grasp with the robot 'planar_gripper'", "wanted or, nr"});
  expect_refused({folder.write("push.yaml", physics_pool::to_yaml(push_ahead())), "--controller", "nr"},
                 {"--controller", "got 'nr' for a task to push", "wanted mpc"});
  expect_refused({easy, "--predictor", "oracle"}, {"--predictor", "got 'oracle'", "wanted fine, coarse"});
  expect_refused({easy, "--predictor", "parareal:1"}, {"--predictor", "robot.model", "wanted a disc"});
  expect_refused({easy, "--uncertainty", "total"}, {"uncertainty", "total", "none, low, medium or high"});
  expect_refused({easy, "--pool", "swimming"}, {"pool", "swimming", "dds", "threads"});
  expect_refused({easy, "--workers", "-1"}, {"workers", "-1"});
  expect_refused({easy, "--workers", "0", "--pool", "threads"}, {"--workers", "got 0", "wanted"});
  expect_refused({easy, "--workers", "many"}, {"--workers", "many"});
  expect_refused({easy, "--pin", "--pool", "threads"}, {"--pin", "got --pool threads", "wanted dds"});
  expect_refused({easy, "--rate", "-1"}, {"rate", "-1"});
  expect_refused({easy, "--parameters", plain, "--domain", "999"}, {"999", "wanted"});
  expect_refused({easy, "--view", "99999"}, {"--view", "got '99999'", "wanted a port, 0 to 65535"});
  expect_refused({}, {"scene"});
}

TEST_F(BadInput, MisspeltWordsAreToldWithTheOneThatWasMeant) {
  expect_refused({easy, "--uncertainty", "mediun"}, {"did you mean medium?"});
  expect_refused({easy, "--controller", "orr"}, {"did you mean or?"});
  expect_refused({easy, "--predictor", "course"}, {"did you mean coarse?"});
  const std::string push = folder.write("push.yaml", physics_pool::to_yaml(push_ahead()));
  expect_refused({push, "--predictor", "coarse,kinematics"},
                 {"wanted kinematic, limit-surface, planar, learned or", "did you mean kinematic?"});
  expect_refused({scene_file([](physics_pool::Scene& s) { s.task.target = "targe"; })}, {"did you mean target?"});
  const std::string robot =
      folder.write("robot.yaml",
                   "jostle_scene: 2\nname: robot\nsurface: {parts: [{x: 0, y: 0, size: [1, 1]}]}\n"
                   "robot: {model: planar_griper}\nobjects: []\ntask: {kind: grasp, target: can}\n");
  expect_refused({robot}, {"wanted planar_gripper, pusher, ur5_2f85", "did you mean planar_gripper?"});
}

TEST_F(BadInput, ArmIsRefusedForARobotThatItDoesNotMove) {
  const std::string push = folder.write("push.yaml", physics_pool::to_yaml(push_ahead()));
  expect_refused({push, "--arm", "ur-sim"}, {"--arm: scene", "got 'pusher', wanted planar_gripper"});
}

TEST_F(BadInput, WorkerRefusesCoresThatItMayNotUse) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--pin", "1023"}, "got 1023, wanted some of"},
      {{"--pin", "0-"}, "got '0-', wanted a list such as 2,3,6-8"},
      {{"--pin", "--threads", "1024"}, "for 1024 threads, wanted one for each"},
  };
  for (const auto& [arguments, words] : cases) {
    const auto worker = program("jostle_worker", arguments);
    EXPECT_EQ(worker->wait(kPatience), 2);
    EXPECT_THAT(worker->err(), HasSubstr("--pin: cores: "));
    EXPECT_THAT(worker->err(), HasSubstr(words));
  }
}

TEST_F(BadInput, ParametersAreRefusedWithFileFieldGotAndWanted) {
  const auto parameters = [&](const std::string& text) { return folder.write("bad.yaml", text).string(); };
  const std::string bad = folder.path() / "bad.yaml";
  expect_refused({easy, "--parameters", folder.path() / "missing.yaml"}, {"missing.yaml"});
  expect_refused({easy, "--parameters", parameters("planner: {rollouts: 0}\n")},
                 {bad, "planner.rollouts", "got 0", "wanted"});
  expect_refused({easy, "--parameters", parameters("planner: {rollouts: many}\n")},
                 {bad, "planner.rollouts", "got 'many'", "wanted"});
  expect_refused({easy, "--parameters", parameters("step_duration: .nan\n")},
                 {bad, "step_duration", "got '.nan'", "wanted"});
  expect_refused({easy, "--parameters", parameters("planer: {rollouts: 8}\n")},
                 {bad, "planer", "did you mean planner"});
  expect_refused({easy, "--parameters", parameters("planner: [\n")}, {bad, "YAML"});
}

// A stranger on the domain of a run that acts.
class Stranger : public RunFixture {
 protected:
  void SetUp() override { ASSERT_NO_FATAL_FAILURE(start_acting(2)); }

  // What the world says of itself now, or nothing.
  std::optional<jostle_msgs::msg::RobotStatus> status() {
    return statuses.take(std::chrono::steady_clock::now() + kPatience);
  }

  template <class Message>
  void send(const wire::Topic<Message>& topic, int readers, const Message& message) {
    auto& writer = *std::static_pointer_cast<wire::Writer<Message>>(
        writers.emplace_back(std::make_shared<wire::Writer<Message>>(participant, topic)));
    ASSERT_TRUE(writer.wait_for_readers(std::chrono::steady_clock::now() + kPatience, readers));
    ASSERT_TRUE(writer.write(message));
  }

  // The run grasps the target, and before that `program`'s log names the problem.
  void expect_named_and_survived(const std::string& log_name, const std::string& problem) {
    std::string words;
    soon(kPatience, [&] {
      const std::string now = log(log_name);
      if (!now.empty()) words = now;
      return words.find(problem) != std::string::npos || run->code();
    });
    EXPECT_THAT(words, HasSubstr(problem));
    EXPECT_EQ(run->wait(kPatience), 0) << run->err();
  }

  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  wire::Inbox<jostle_msgs::msg::RobotStatus> statuses{participant, wire::topics::kRobotStatus, 1};
  std::vector<std::shared_ptr<wire::WriterBase>> writers;
};

TEST_F(Stranger, ObjectsOfAnotherWorldAreDroppedByName) {
  jostle_msgs::msg::ObjectStates objects;
  objects.objects().resize(2);
  objects.objects()[0].name("target");
  objects.objects()[0].pose().orientation().w(1.0);
  objects.objects()[1].name("can");
  objects.objects()[1].pose().position().x(kNaN);

  send(wire::topics::kObjectStates, 1, objects);

  expect_named_and_survived("coordinator.log",
                            fmt::format("a measurement of participant {:016x} was dropped", participant.id()));
}

TEST_F(Stranger, StatusOfAnotherRobotIsDroppedByName) {
  auto spoilt = status();
  ASSERT_TRUE(spoilt);
  spoilt->q().at(2) = -kNaN;
  spoilt->busy(false);

  send(wire::topics::kRobotStatus, 3, *spoilt);  // run, coordinator, this test

  expect_named_and_survived("coordinator.log",
                            fmt::format("a status of participant {:016x} was dropped", participant.id()));
}

TEST_F(Stranger, TakesTheRobotFromNobodyWhoIsThere) {
  const auto now = status();
  ASSERT_TRUE(now);
  jostle_msgs::msg::VelocityCommand command;
  command.epoch(now->epoch() + 1'000'000'000);
  command.sequence_number(1);
  command.velocities({0.0, 0.0, 0.0, 0.0});
  command.duration(0.1);

  send(wire::topics::kRobotCommand, 1, command);

  expect_named_and_survived("sim.log",
                            fmt::format("a command of participant {:016x} waits: the robot obeys", participant.id()));
}

}  // namespace
}  // namespace jostle::tests
