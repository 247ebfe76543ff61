// jostle keys as a user types it.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/support/program_process.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Keys : public ::testing::Test {
 protected:
  // Runs to its end and gives the exit code.
  int keys(const std::vector<std::string>& arguments) {
    program = std::make_unique<ProgramProcess>("jostle_keys", arguments, folder);
    return program->wait(60s).value_or(-1);
  }

  void expect_refused(int code, const std::vector<std::string>& arguments, const std::vector<std::string>& words) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    EXPECT_EQ(keys(arguments), code);
    for (const std::string& word : words) EXPECT_THAT(program->err() + program->out(), HasSubstr(word));
  }

  TempFolder folder;
  std::string store = folder.path() / "lab-keys";
  std::unique_ptr<ProgramProcess> program;
};

TEST_F(Keys, InitMakesARobotAndAWorkerThatCheckAccepts) {
  ASSERT_EQ(keys({"init", store}), 0) << program->err();
  EXPECT_THAT(program->out(), HasSubstr(store + "/identities/robot"));
  EXPECT_THAT(program->out(), HasSubstr(store + "/identities/worker"));

  EXPECT_EQ(keys({"check", store + "/identities/robot"}), 0) << program->err();
  EXPECT_THAT(program->out(), HasSubstr("ok CN=robot,OU=robot,O=Jostle\n"));
  EXPECT_THAT(program->out(), HasSubstr("publishes    every topic\n"));
  EXPECT_EQ(keys({"check", store + "/identities/worker"}), 0) << program->err();
  EXPECT_THAT(program->out(), HasSubstr("publishes    rt/pool/worker, rt/pool/result, rt/doctor/there, "
                                        "rt/doctor/back\nsubscribes   rt/pool/*, rt/doctor/*\n"));
  EXPECT_THAT(program->err(), IsEmpty());
}

TEST_F(Keys, IssueTakesRoleAndDaysAndListKnowsThem) {
  ASSERT_EQ(keys({"init", store}), 0);
  ASSERT_EQ(keys({"issue", store, "recorder", "--role", "observer", "--days", "30"}), 0) << program->err();

  ASSERT_EQ(keys({"list", store, "--json"}), 0);
  const auto list = nlohmann::json::parse(program->out());
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[2]["name"], "recorder");
  EXPECT_EQ(list[2]["role"], "observer");
  EXPECT_EQ(list[2]["state"], "valid");
  EXPECT_THAT(list[2]["valid_until"].get<std::string>(), ::testing::MatchesRegex("20..-..-..T..:..:..Z"));
  ASSERT_EQ(keys({"list", store}), 0);
  EXPECT_THAT(program->out(), HasSubstr("recorder                 observer"));
}

TEST_F(Keys, RevokeIsSeenByCheckAndSaysThatOthersNeedTheList) {
  ASSERT_EQ(keys({"init", store}), 0);

  ASSERT_EQ(keys({"revoke", store, "worker"}), 0) << program->err();

  EXPECT_THAT(program->out(), HasSubstr(store + "/identities/robot/crl.pem"));
  EXPECT_THAT(program->out(), HasSubstr("Other hosts' copies need the new crl.pem, too"));
  expect_refused(2, {"check", store + "/identities/worker"}, {"revoked on"});
  EXPECT_EQ(keys({"issue", store, "worker"}), 0) << program->err();
  EXPECT_EQ(keys({"check", store + "/identities/worker"}), 0) << program->err();
}

TEST_F(Keys, NeverOverwrites) {
  ASSERT_EQ(keys({"init", store}), 0);
  const std::string key = contents(fs::path(store) / "ca" / "ca.key");

  expect_refused(2, {"init", store}, {store + ": got something that is there already"});
  expect_refused(2, {"issue", store, "robot"}, {"name: got 'robot', which is valid until"});

  EXPECT_EQ(contents(fs::path(store) / "ca" / "ca.key"), key);
}

TEST_F(Keys, RefusesBadInputWithExitCodeTwo) {
  ASSERT_EQ(keys({"init", store}), 0);
  expect_refused(2, {"check", store}, {"give one of its identities: " + store + "/identities/robot, "});
  expect_refused(2, {"check", store + "/nowhere"}, {"missing"});
  expect_refused(2, {"issue", store, "../x"}, {"name: got '../x'"});
  expect_refused(2, {"issue", store, "x", "--role", "chef"}, {"--role", "robot"});
  expect_refused(2, {"issue", store, "x", "--days", "0"}, {"--days"});
  expect_refused(2, {"revoke", store, "nobody"}, {"issued: robot, worker"});
  expect_refused(2, {"list", folder.path() / "none"}, {"jostle keys init"});
  expect_refused(2, {}, {"subcommand"});
}

TEST_F(Keys, CheckSaysThatAKeyLiesOpen) {
  ASSERT_EQ(keys({"init", store}), 0);
  fs::permissions(fs::path(store) / "identities/robot/key.pem", fs::perms::others_read, fs::perm_options::add);

  EXPECT_EQ(keys({"check", store + "/identities/robot"}), 0);

  EXPECT_THAT(program->err(), HasSubstr("chmod 600"));
}

TEST_F(Keys, HelpHasAnExampleToFollow) {
  ASSERT_EQ(keys({"--help"}), 0);
  for (const char* word : {"jostle keys init", "scp", "jostle keys check", "--secure"}) {
    EXPECT_THAT(program->out(), HasSubstr(word));
  }
}

}  // namespace
}  // namespace jostle::tests
