// An arm on one host and what drives it on another: the cable between them is pulled out.

#include <gtest/gtest.h>

#include "services/common/lab/hosts.hpp"
#include "tests/support/arm_parts.hpp"

namespace jostle::tests {
namespace {

using common::Hosts;

constexpr int kArm = 1, kPlanner = 2;  // hosts

class ArmCable : public ArmParts {
 protected:
  void SetUp() override {
    auto hosts_result = Hosts::make(2);
    ASSERT_TRUE(hosts_result) << hosts_result.error().message;
    hosts = std::move(hosts_result).value();
    address = Hosts::address(kArm);
    const auto on = [this](int host) {
      return [this, host](const std::string& name, const std::vector<std::string>& arguments) {
        std::unique_ptr<ProgramProcess> process;
        hosts->on(host, [&] { process = program(name, arguments); });
        return process;
      };
    };
    at_the_arm = on(kArm);
    at_the_planner = on(kPlanner);
    look_on = [this](const auto& act) { hosts->on(kArm, act); };
    watchdog = "0.067";  // as it is unless told otherwise
  }

  std::unique_ptr<Hosts> hosts;
};

TEST_F(ArmCable, PulledOutStopsTheArmWithin200Milliseconds) {
  ASSERT_NO_FATAL_FAILURE(start_moving());
  hosts->plug(kPlanner, false);
  const double out = onlooker->next().time;
  EXPECT_LT(time_to_stand(out), 0.2);
  // Plugged in again, nothing that is old is obeyed.
  hosts->plug(kPlanner, true);
  const double in = onlooker->next().time;
  for (auto sample = onlooker->next(); sample.time < in + 1.0; sample = onlooker->next()) {
    ASSERT_LT(sample.fastest, kStill) << sample.time - in;
  }
}

}  // namespace
}  // namespace jostle::tests
