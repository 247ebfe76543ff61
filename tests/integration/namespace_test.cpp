// Several robots on one domain: each in a namespace of its own, all on the same workers.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;

class Namespace : public RunFixture {
 protected:
  // The arguments of a run to its grasp; the seed decides what is planned and done.
  std::vector<std::string> grasp(const std::string& name, int seed, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {easy, "--headless", "--workers", "1", "--parameters", plain, "--seed",
                               std::to_string(seed), "--json", file(name)});
    return more;
  }

  std::string file(const std::string& name) const { return folder.path() / (name + ".json"); }

  // All that a run did, without how long it took and who helped.
  json deeds(const std::string& name) const {
    const json report = json::parse(contents(file(name)), nullptr, false);
    json deeds;
    for (const char* key : {"success", "reason", "scene_hash", "seed", "plan_hash", "cost", "iterations", "replans",
                            "actions", "observed_states"}) {
      deeds[key] = report.value(key, json("missing"));
    }
    return deeds;
  }
};

TEST_F(Namespace, TwoRunsAtATimeGraspAsEachDoesAlone) {
  for (const int seed : {7, 8})
    ASSERT_EQ(program("jostle_run", grasp("alone-" + std::to_string(seed), seed))->wait(kPatience), 0);
  ASSERT_NE(deeds("alone-7"), deeds("alone-8")) << "what one did could pass for the other's";

  const auto left = program("jostle_run", grasp("left", 7, {"--namespace", "left"}));
  const auto right = program("jostle_run", grasp("right", 8, {"--namespace", "lab/right"}));
  EXPECT_EQ(left->wait(kPatience), 0) << left->err();
  EXPECT_EQ(right->wait(kPatience), 0) << right->err();

  EXPECT_EQ(deeds("left"), deeds("alone-7"));
  EXPECT_EQ(deeds("right"), deeds("alone-8"));
}

TEST_F(Namespace, TopicsAreThoseOfRos2AndWorkersAreEverybodys) {
  const auto participant = wire::Participant::open({.domain = domain}).value();
  const auto named = [](const std::string& name, const Qos& qos) {
    return wire::Topic<jostle_msgs::msg::Feedback>{name, qos, wire::Scope::kDomain};
  };
  wire::Inbox<jostle_msgs::msg::Feedback> inside(participant,
                                                 named("rt/left/task/feedback", wire::topics::kTaskFeedback.qos), 64);
  wire::Inbox<jostle_msgs::msg::Feedback> outside(participant, wire::topics::kTaskFeedback, 64);
  const WorkerProcess worker(domain);  // without a namespace

  const auto left = program("jostle_run", {easy, "--headless", "--workers", "0", "--plan-only", "--parameters", plain,
                                           "--namespace", "/left"});

  EXPECT_EQ(left->wait(kPatience), 0) << left->err();
  EXPECT_TRUE(inside.take(in(1s)));
  EXPECT_TRUE(outside.take_all().empty());
}

TEST_F(Namespace, OfARunIsItsOwn) {
  const auto first =
      program("jostle_run", {easy, "--headless", "--workers", "1", "--parameters", endless, "--namespace", "left"});
  ASSERT_TRUE(first->says("planning", kPatience)) << first->err();

  const auto second = program("jostle_run", grasp("second", 7, {"--namespace", "left"}));

  EXPECT_EQ(second->wait(kPatience), 3);
  EXPECT_THAT(second->err(), HasSubstr("got another run on this machine in namespace left, wanted none"));
  EXPECT_THAT(second->err(), HasSubstr("--namespace"));
}

TEST_F(Namespace, ThatIsNoneIsRefused) {
  const auto run_result = program("jostle_run", grasp("none", 7, {"--namespace", "left-arm"}));
  EXPECT_EQ(run_result->wait(kPatience), 2);
  EXPECT_THAT(run_result->err(),
              HasSubstr("namespace: got 'left-arm', wanted words of letters, digits and single underscores"));
}

}  // namespace
}  // namespace jostle::tests
