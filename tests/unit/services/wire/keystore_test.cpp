#include "services/wire/security/keystore.hpp"

#include <fnmatch.h>
#include <gmock/gmock.h>

#include <thread>

#include "tests/support/forgery.hpp"

namespace jostle::wire::keystore {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

class Keystore : public ::testing::Test {
 protected:
  template <class T>
  static void expect_refused(const Result<T>& result, const std::vector<std::string>& words) {
    ASSERT_FALSE(result);
    for (const std::string& word : words) EXPECT_THAT(result.error().message, HasSubstr(word));
  }

  static fs::perms mode(const fs::path& file) { return fs::status(file).permissions(); }

  tests::TempFolder folder;
  fs::path keys = folder.path() / "keys";
};

TEST_F(Keystore, KeepsSecretsToItsOwner) {
  ASSERT_TRUE(create(keys));
  const fs::path arm = tests::sure(issue(keys, "arm", Role::kRobot, std::chrono::days(1)));

  constexpr fs::perms kSecret = fs::perms::owner_read | fs::perms::owner_write;
  EXPECT_EQ(mode(keys / "ca" / "ca.key"), kSecret);
  EXPECT_EQ(mode(arm / "key.pem"), kSecret);
  EXPECT_EQ(mode(keys), fs::perms::owner_all);
  EXPECT_EQ(mode(keys / "ca"), fs::perms::owner_all);
  EXPECT_EQ(mode(arm), fs::perms::owner_all);
}

TEST_F(Keystore, IsMadeInAnEmptyFolderYetNeverOverAnything) {
  fs::create_directories(keys);
  EXPECT_TRUE(create(keys));
  const std::string key = tests::contents(keys / "ca" / "ca.key");

  expect_refused(create(keys), {keys.string() + ": got something that is there already", "new or empty folder"});
  EXPECT_EQ(tests::contents(keys / "ca" / "ca.key"), key);
  expect_refused(create(folder.write("file", "text")), {"there already"});
}

TEST_F(Keystore, ThatIsNoneIsRefusedWithTheRemedy) {
  const std::vector<std::string> words{keys.string() + ": got no ca/index.json", "wanted a keystore",
                                       "jostle keys init " + keys.string()};
  expect_refused(issue(keys, "arm", Role::kRobot, std::chrono::days(1)), words);
  expect_refused(revoke(keys, "arm"), words);
  expect_refused(list(keys), words);
}

TEST_F(Keystore, WithASpoiltIndexIsRefusedNamingIt) {
  ASSERT_TRUE(create(keys));
  tests::overwrite(keys / "ca" / "index.json", "{\"identities\": [{\"name\": 7}]}");
  expect_refused(list(keys), {"index.json: got no index of a keystore"});
  tests::overwrite(keys / "ca" / "index.json", "fruit: apple");
  expect_refused(issue(keys, "arm", Role::kRobot, std::chrono::days(1)), {"index.json"});
}

TEST_F(Keystore, RefusesNamesThatAreNoFolder) {
  ASSERT_TRUE(create(keys));
  for (const std::string& name : {std::string(), std::string("../x"), std::string(".x"), std::string("-x"),
                                  std::string("a b"), std::string("a,b"), std::string("<x>"), std::string(65, 'x')}) {
    expect_refused(issue(keys, name, Role::kRobot, std::chrono::days(1)), {"name: got '" + name + "'", "wanted"});
  }
  EXPECT_TRUE(issue(keys, std::string(64, 'x'), Role::kRobot, std::chrono::days(1)));
}

TEST_F(Keystore, RefusesIdentitiesThatOutliveIt) {
  ASSERT_TRUE(create(keys));

  expect_refused(issue(keys, "arm", Role::kRobot, kLifetime + std::chrono::days(1)),
                 {"days: got 3651, wanted at most 3650", "the keystore itself ends on"});
  EXPECT_TRUE(issue(keys, "arm", Role::kRobot, kLifetime));
}

TEST_F(Keystore, NeverReplacesAValidIdentityYetExpiredAndRevokedOnes) {
  ASSERT_TRUE(create(keys));
  const fs::path arm = tests::sure(issue(keys, "arm", Role::kRobot, std::chrono::days(1)));
  const std::string key = tests::contents(arm / "key.pem");
  expect_refused(issue(keys, "arm", Role::kRobot, std::chrono::days(9)),
                 {"name: got 'arm', which is valid until", "jostle keys revoke " + keys.string() + " arm"});
  EXPECT_EQ(tests::contents(arm / "key.pem"), key);

  ASSERT_TRUE(revoke(keys, "arm"));
  ASSERT_TRUE(issue(keys, "arm", Role::kRobot, std::chrono::days(-1)));
  ASSERT_TRUE(issue(keys, "arm", Role::kRobot, std::chrono::days(9)));

  EXPECT_NE(tests::contents(arm / "key.pem"), key);
  EXPECT_TRUE(open_identity(arm));
}

TEST_F(Keystore, ListsNameRoleEndAndState) {
  ASSERT_TRUE(create(keys));
  ASSERT_TRUE(issue(keys, "arm", Role::kRobot, std::chrono::days(7)));
  ASSERT_TRUE(issue(keys, "old", Role::kObserver, std::chrono::days(-1)));
  ASSERT_TRUE(issue(keys, "lost", Role::kWorker, std::chrono::days(7)));
  ASSERT_TRUE(revoke(keys, "lost"));

  const auto entries = tests::sure(list(keys));

  ASSERT_THAT(entries,
              ElementsAre(Field(&Entry::name, "arm"), Field(&Entry::name, "old"), Field(&Entry::name, "lost")));
  EXPECT_THAT(entries, ElementsAre(Field(&Entry::role, Role::kRobot), Field(&Entry::role, Role::kObserver),
                                   Field(&Entry::role, Role::kWorker)));
  EXPECT_THAT(entries, ElementsAre(Field(&Entry::state, State::kValid), Field(&Entry::state, State::kExpired),
                                   Field(&Entry::state, State::kRevoked)));
  EXPECT_EQ(entries[0].serial, serial_of(*tests::sure(load_certificate(keys / "identities/arm/cert.pem"))));
  const auto later = std::chrono::system_clock::now() + std::chrono::days(8);
  EXPECT_EQ(tests::sure(list(keys, later))[0].state, State::kExpired);
}

TEST_F(Keystore, RevocationReachesEveryIdentityFolder) {
  ASSERT_TRUE(create(keys));
  for (const char* name : {"arm", "lost"}) ASSERT_TRUE(issue(keys, name, Role::kRobot, std::chrono::days(7)));

  const auto files = tests::sure(revoke(keys, "lost"));

  EXPECT_THAT(files, UnorderedElementsAre(keys / "ca/crl.pem", keys / "identities/arm/crl.pem",
                                          keys / "identities/lost/crl.pem"));
  const std::string list = tests::contents(files[0]);
  for (const fs::path& file : files) EXPECT_EQ(tests::contents(file), list);
  const fs::path later = tests::sure(issue(keys, "later", Role::kRobot, std::chrono::days(7)));
  X509_REVOKED* entry = nullptr;
  EXPECT_EQ(X509_CRL_get0_by_cert(tests::sure(load_revocation_list(later / "crl.pem")).get(), &entry,
                                  tests::sure(load_certificate(keys / "identities/lost/cert.pem")).get()),
            1);
}

TEST_F(Keystore, RevokingWhatWasNeverIssuedIsRefusedNamingWhatWas) {
  ASSERT_TRUE(create(keys));
  expect_refused(revoke(keys, "arm"), {"name: got 'arm'", "none yet"});
  for (const char* name : {"worker", "arm"}) ASSERT_TRUE(issue(keys, name, Role::kRobot, std::chrono::days(7)));
  expect_refused(revoke(keys, "arn"), {"name: got 'arn'", "issued: arm, worker"});
}

TEST_F(Keystore, IssuesSideBySideWithoutForgettingOne) {
  ASSERT_TRUE(create(keys));
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 8; ++i) {
      threads.emplace_back(
          [&, i] { EXPECT_TRUE(issue(keys, "arm" + std::to_string(i), Role::kRobot, std::chrono::days(1))); });
    }
  }
  EXPECT_THAT(tests::sure(list(keys)), SizeIs(8));
}

TEST_F(Keystore, LeavesNoHalfMadeIdentityBehind) {
  ASSERT_TRUE(create(keys));
  fs::remove(keys / "ca" / "governance.p7s");

  expect_refused(issue(keys, "arm", Role::kRobot, std::chrono::days(1)), {"governance.p7s: missing"});

  EXPECT_TRUE(fs::is_empty(keys / "identities"));
  EXPECT_THAT(tests::sure(list(keys)), SizeIs(0));
}

// As Fast DDS matches topics: fnmatch without FNM_PATHNAME.
bool matches(const std::vector<std::string>& patterns, const std::string& topic) {
  return std::ranges::any_of(
      patterns, [&](const std::string& pattern) { return fnmatch(pattern.c_str(), topic.c_str(), FNM_NOESCAPE) == 0; });
}

TEST(Roles, LetAWorkerSayResultsAndNothingToARobot) {
  const Rights worker = rights_of(Role::kWorker);
  for (const char* topic : {"rt/pool/worker", "rt/pool/result", "rt/doctor/there", "rt/doctor/back"})
    EXPECT_TRUE(matches(worker.publish, topic)) << topic;
  for (const char* topic :
       {"rt/robot/command", "rt/x/robot/command", "rt/pool/robot/command", "rt/pool/assignment/w1", "rt/pool/world",
        "rt/pool/control", "rt/task/goal", "rt/tf", "rt/x/pool/result", "rt/x/doctor/back"}) {
    EXPECT_FALSE(matches(worker.publish, topic)) << topic;
  }
  for (const char* topic : {"rt/pool/world", "rt/pool/control", "rt/pool/assignment/w0123456789abcdef"}) {
    EXPECT_TRUE(matches(worker.subscribe, topic)) << topic;
  }
  for (const char* topic : {"rt/robot/command", "rt/x/robot/command", "rt/joint_states", "rt/task/goal"}) {
    EXPECT_FALSE(matches(worker.subscribe, topic)) << topic;
  }
}

TEST(Roles, LetARobotDoAllAnObserverHearAllAndAServerNothing) {
  const std::string topic = "rt/x/robot/command";
  EXPECT_TRUE(matches(rights_of(Role::kRobot).publish, topic));
  EXPECT_TRUE(matches(rights_of(Role::kRobot).subscribe, topic));
  EXPECT_FALSE(matches(rights_of(Role::kObserver).publish, topic));
  EXPECT_TRUE(matches(rights_of(Role::kObserver).subscribe, topic));
  EXPECT_FALSE(matches(rights_of(Role::kServer).publish, topic));
  EXPECT_FALSE(matches(rights_of(Role::kServer).subscribe, topic));
}

TEST(Roles, AreReadByTheNamesTheyAreWrittenWith) {
  for (const Role role : kRoles) EXPECT_EQ(parse_role(to_string(role)), role);
  EXPECT_FALSE(parse_role("chef"));
}

}  // namespace
}  // namespace jostle::wire::keystore
