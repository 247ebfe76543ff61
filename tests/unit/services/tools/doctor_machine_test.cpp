// Checks of processors, programs and the network that need no other machine and no rights.

#include "services/tools/doctor/machine.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>

#include "services/common/process/files.hpp"
#include "services/tools/doctor/network.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tools {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

void expect_remedy_unless_ok(const Check& check) {
  EXPECT_FALSE(check.finding.empty()) << check.name;
  EXPECT_EQ(check.remedy.empty(), check.verdict == Verdict::kOk) << check.name << ": " << check.finding;
}

TEST(DoctorMachine, CoresAreCountedAndTheirLoadIsNoFailure) {
  const Check check = check_cores();
  EXPECT_EQ(check.name, "cores");
  EXPECT_THAT(check.finding, HasSubstr(" cores, load "));
  EXPECT_NE(check.verdict, Verdict::kFail);
  expect_remedy_unless_ok(check);
}

TEST(DoctorMachine, VersionsAreThoseOfEngineAndMiddleware) {
  const auto checks = check_versions();
  ASSERT_EQ(checks.size(), 2u);
  EXPECT_EQ(checks[0].name, "MuJoCo");
  EXPECT_EQ(checks[1].name, "Fast DDS");
  for (const Check& check : checks) {
    EXPECT_EQ(check.verdict, Verdict::kOk);
    EXPECT_THAT(check.finding, testing::ContainsRegex("^[0-9]+[.][0-9]+")) << check.name;
  }
}

TEST(DoctorMachine, WorkerIsLookedForBesideThisProgram) {
  const auto worker = common::program_folder() / "jostle_worker";
  const Check check = check_worker();
  EXPECT_THAT(check.finding, StartsWith(worker.string()));
  EXPECT_EQ(check.verdict, access(worker.c_str(), X_OK) == 0 ? Verdict::kOk : Verdict::kFail);
  expect_remedy_unless_ok(check);
}

TEST(DoctorNetwork, UdpBuffersAreMeasuredAgainstWhatIsWanted) {
  const Check check = check_udp_buffers();
  EXPECT_NE(check.verdict, Verdict::kFail);
  EXPECT_THAT(check.finding, HasSubstr("net.core.rmem_max"));
  expect_remedy_unless_ok(check);
}

// ROS_DOMAIN_ID and JOSTLE_PROFILES are the test's.
class DoctorEnvironment : public testing::Test {
 protected:
  DoctorEnvironment() { clear(); }
  ~DoctorEnvironment() override { clear(); }

  static void clear() {
    unsetenv("ROS_DOMAIN_ID");
    unsetenv("JOSTLE_PROFILES");
  }
};

TEST_F(DoctorEnvironment, DomainIsTheOneAskedForElseTheEnvironments) {
  EXPECT_EQ(check_domain(7).finding, "7");
  EXPECT_EQ(check_domain({}).finding, "0");
  setenv("ROS_DOMAIN_ID", "12", 1);
  EXPECT_EQ(check_domain({}).finding, "12");
  EXPECT_EQ(check_domain(7).finding, "7");
  EXPECT_EQ(check_domain(7).verdict, Verdict::kOk);
}

TEST_F(DoctorEnvironment, DomainThatIsNoneFailsWithWhatWasGot) {
  for (const char* text : {"-1", "233", "seven", "7.5"}) {
    setenv("ROS_DOMAIN_ID", text, 1);
    const Check check = check_domain({});
    EXPECT_EQ(check.verdict, Verdict::kFail) << text;
    EXPECT_THAT(check.finding, HasSubstr(text));
    EXPECT_THAT(check.remedy, HasSubstr("ROS_DOMAIN_ID"));
  }
}

TEST_F(DoctorEnvironment, ProfilesThatCannotBeUsedFail) {
  const tests::TempFolder folder;
  for (const auto& file : {folder.path() / "nowhere.xml", folder.write("broken.xml", "<profiles><participant")}) {
    setenv("JOSTLE_PROFILES", file.c_str(), 1);
    const Check check = check_profiles();
    EXPECT_EQ(check.verdict, Verdict::kFail) << file;
    EXPECT_THAT(check.finding, HasSubstr(file.filename().string()));
    expect_remedy_unless_ok(check);
  }
}

}  // namespace
}  // namespace jostle::tools
