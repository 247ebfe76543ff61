// Who is kept out of a protected domain, and who may do what inside.
//
// Every case has two groups on one domain: robots with identities of a lab, and
// strangers. Both talk among themselves, so both are there and their network
// works; nothing may cross.

#include <gmock/gmock.h>

#include <sstream>

#include "tests/support/forgery.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;
using wire::Role;

constexpr auto kPatience = 60s;
const std::string kCommand = "rt/robot/command";
const std::string kElsewhere = "rt/x/robot/command";
const std::string kResult = "rt/pool/result";
const std::string kHeartbeat = "rt/pool/worker";
const std::string kAssignment = "rt/pool/assignment/w0123456789abcdef";
// Two seconds of samples: authentication takes 0.1 s, announcements come twice a second.
constexpr int kMany = 100;

using Words = std::vector<std::string>;

// One security_peer.
class Peer {
 public:
  Peer(const TempFolder& folder, const std::string& name, const Words& credentials, const Words& publish,
       const Words& subscribe)
      : name_(name), process_("jostle_security_peer", arguments(name, credentials, publish, subscribe), folder) {}

  const std::string& name() const { return name_; }

  bool is_ready() { return says("ready"); }

  bool says(const std::string& line) {
    return soon(kPatience, [&] { return holds(line) || process_.code(); }) && holds(line);
  }

  // Samples it got of a peer, on whatever topic or on one.
  int count(const std::string& from, const std::string& topic = "") const {
    std::istringstream lines(process_.out());
    int result = 0;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string kind, heard, speaker;
      words >> kind >> heard >> speaker;
      if (kind == "got" && speaker == from && (topic.empty() || topic == heard)) ++result;
    }
    return result;
  }

  // Waits until it got so many more than now.
  bool gets(const Peer& from, const std::string& topic, int samples = kMany) const {
    const int before = count(from.name(), topic);
    return soon(kPatience, [&] { return count(from.name(), topic) >= before + samples; });
  }

  bool holds(const std::string& wanted) const {
    std::istringstream lines(out());
    for (std::string line; std::getline(lines, line);) {
      if (line == wanted) return true;
    }
    return false;
  }
  std::string out() const { return process_.out(); }
  std::string err() const { return process_.err(); }
  std::optional<int> wait() { return process_.wait(kPatience); }

 private:
  static Words arguments(const std::string& name, const Words& credentials, const Words& publish,
                         const Words& subscribe) {
    Words words{"--domain", std::to_string(test_domain()), "--name", name};
    words.insert(words.end(), credentials.begin(), credentials.end());
    for (const std::string& topic : publish) words.insert(words.end(), {"--publish", topic});
    for (const std::string& topic : subscribe) words.insert(words.end(), {"--subscribe", topic});
    return words;
  }

  std::string name_;
  ProgramProcess process_;
};

class Strangers : public ::testing::Test {
 protected:
  // A peer that says commands and hears them.
  std::unique_ptr<Peer> talker(const std::string& name, const Words& credentials) {
    return std::make_unique<Peer>(folder, name, credentials, Words{kCommand}, Words{kCommand});
  }

  Words secure(const fs::path& identity) const { return {"--secure", identity.string()}; }

  // Robots and strangers, all of which say and hear commands, and nothing crosses.
  void expect_apart(const Words& one, const Words& two) {
    const auto robot_a = talker("robot-a", secure(arm)), robot_b = talker("robot-b", secure(other_arm));
    const auto stranger_a = talker("stranger-a", one), stranger_b = talker("stranger-b", two);
    for (const auto* peer : {&robot_a, &robot_b, &stranger_a, &stranger_b}) {
      ASSERT_TRUE((*peer)->is_ready()) << (*peer)->out() << (*peer)->err();
    }

    // Long after everybody is there, everybody hears his like …
    ASSERT_TRUE(robot_a->gets(*robot_b, kCommand)) << robot_a->out() << robot_a->err();
    ASSERT_TRUE(robot_b->gets(*robot_a, kCommand, 10));
    ASSERT_TRUE(stranger_a->gets(*stranger_b, kCommand)) << stranger_a->out() << stranger_a->err();
    ASSERT_TRUE(stranger_b->gets(*stranger_a, kCommand, 10));
    // … and nobody else.
    for (const auto* robot : {&robot_a, &robot_b}) EXPECT_THAT((*robot)->out(), Not(HasSubstr("stranger")));
    for (const auto* stranger : {&stranger_a, &stranger_b}) EXPECT_THAT((*stranger)->out(), Not(HasSubstr("robot-")));
  }

  TempFolder folder;
  Lab lab{folder.path() / "lab"};
  fs::path arm = lab.issue("arm", Role::kRobot);
  fs::path other_arm = lab.issue("other-arm", Role::kRobot);
};

TEST_F(Strangers, WithoutIdentityAreKeptApart) { expect_apart({}, {}); }

// Who looks for workers from the other side of the fence is told that there is one.
TEST_F(Strangers, AreNamedAsTheCauseWhenNobodyIsHeard) {
  ProgramProcess worker("jostle_worker", {}, folder);
  ASSERT_TRUE(worker.says("rollouts at a time", kPatience)) << worker.err();

  EXPECT_TRUE(soon(kPatience, [&] {
    ProgramProcess tool("jostle_workers", {"--seconds", "1", "--secure", arm.string()}, folder);
    return tool.wait(kPatience) == 1 && tool.err().find("unprotected and this program is protected") != tool.err().npos;
  }));
}

TEST_F(Strangers, OfAnotherKeystoreAreKeptApart) {
  const Lab foreign(folder.path() / "foreign");

  expect_apart(secure(foreign.issue("arm", Role::kRobot)), secure(foreign.issue("other-arm", Role::kRobot)));
}

TEST_F(Strangers, WhoseIdentityExpiredAreRefusedByUsAndByFastDds) {
  const fs::path old = lab.issue("old", Role::kRobot, -3);

  const auto sut = talker("old", secure(old)), raw = talker("raw", {"--raw", old.string()});

  EXPECT_EQ(sut->wait(), 2);
  EXPECT_THAT(sut->err(), HasSubstr("expired"));
  EXPECT_TRUE(raw->says("refused participant")) << raw->out();
}

// The same with a clock that is late on purpose, so that its own side accepts it.
TEST_F(Strangers, WhoseIdentityExpiredAreKeptApartWhateverTheirClocksSay) {
  const Words fortnight_ago{"--behind", std::to_string(14 * 86'400)};
  Words one{"--raw", lab.issue("old", Role::kRobot, -7).string(), "--no-crl"};
  Words two{"--raw", lab.issue("older", Role::kRobot, -8).string(), "--no-crl"};
  // The authority must have been there a fortnight ago, too: an older one takes its place.
  const std::time_t now = std::time(nullptr);
  constexpr std::time_t kDay = 86'400;
  const wire::Authority authority = wire::make_authority("Jostle CA old", {now - 90 * kDay, now + 90 * kDay});
  for (const fs::path& place : {arm, other_arm, fs::path(one[1]), fs::path(two[1])}) {
    const bool is_old = place != arm && place != other_arm;
    const wire::Period period{now - 30 * kDay, is_old ? now - 7 * kDay : now + 30 * kDay};
    const wire::Key key = wire::make_key();
    const auto certificate =
        wire::make_certificate(authority, *key, {place.filename().string(), "robot"}, wire::make_serial(), period);
    wire::Grant grant = full_grant(wire::name_of(X509_get_subject_name(certificate.get())));
    grant.validity = period;
    const auto sign = [&](const std::string& text) {
      return wire::sign_text(*authority.certificate, *authority.key, text);
    };
    overwrite(place / "ca.pem", wire::to_pem(*authority.certificate));
    overwrite(place / "cert.pem", wire::to_pem(*certificate));
    overwrite(place / "key.pem", wire::to_pem(*key));
    overwrite(place / "governance.p7s", sign(wire::governance_text()));
    overwrite(place / "permissions.p7s", sign(wire::permissions_text(grant)));
    overwrite(place / "crl.pem",
              wire::to_pem(*wire::make_revocation_list(authority, {}, {now - 30 * kDay, now + 30 * kDay})));
  }
  for (Words* words : {&one, &two}) words->insert(words->end(), fortnight_ago.begin(), fortnight_ago.end());

  expect_apart(one, two);
}

TEST_F(Strangers, WhoseIdentityWasRevokedAreRefusedByUsAndByFastDds) {
  const fs::path lost = lab.issue("lost", Role::kRobot);
  ASSERT_TRUE(wire::keystore::revoke(lab.folder(), "lost"));

  const auto sut = talker("lost", secure(lost)), raw = talker("raw", {"--raw", lost.string()});

  EXPECT_EQ(sut->wait(), 2);
  EXPECT_THAT(sut->err(), HasSubstr("revoked"));
  EXPECT_TRUE(raw->says("refused participant")) << raw->out();
}

// A thief does not read the list of stolen identities.
TEST_F(Strangers, WhoseIdentityWasRevokedAreKeptApartThoughTheyIgnoreTheList) {
  const fs::path one = lab.issue("lost", Role::kRobot), two = lab.issue("stolen", Role::kRobot);
  for (const char* name : {"lost", "stolen"}) ASSERT_TRUE(wire::keystore::revoke(lab.folder(), name));

  expect_apart({"--raw", one.string(), "--no-crl"}, {"--raw", two.string(), "--no-crl"});
}

// Without the list on the other side the same two would be let in: what keeps
// them out above is the list, and Fast DDS's property for it works.
TEST_F(Strangers, WhoseIdentityWasRevokedAreHeardByWhoHasAnOldList) {
  const fs::path lost = lab.issue("lost", Role::kRobot);
  const fs::path copy = folder.path() / "copy of arm";
  fs::copy(arm, copy);
  ASSERT_TRUE(wire::keystore::revoke(lab.folder(), "lost"));

  const auto careless = talker("careless", secure(copy)), thief = talker("thief", {"--raw", lost.string(), "--no-crl"});

  EXPECT_TRUE(careless->gets(*thief, kCommand, 10)) << careless->out() << careless->err();
}

// An insider who writes himself permissions, and makes his own side believe them.
TEST_F(Strangers, WithPermissionsOfTheirOwnMakingAreKeptApart) {
  const wire::Authority rogue =
      wire::make_authority("Rogue", {std::time(nullptr) - 86'400, std::time(nullptr) + 86'400});
  const std::string both =
      folder.write("both.pem", contents(lab.folder() / "ca" / "ca.pem") + wire::to_pem(*rogue.certificate));
  std::vector<Words> credentials;
  for (const char* name : {"helper", "other-helper"}) {
    const fs::path identity = lab.issue(name, Role::kWorker);
    overwrite(identity / "permissions.p7s", wire::sign_text(*rogue.certificate, *rogue.key,
                                                            wire::permissions_text(full_grant(subject_of(identity)))));
    credentials.push_back({"--raw", identity.string(), "--permissions-ca", both});
  }

  expect_apart(credentials[0], credentials[1]);
}

TEST_F(Strangers, CannotSignPermissionsWithTheirCertificate) {
  const fs::path helper = lab.issue("helper", Role::kWorker);
  const auto certificate = sure(wire::load_certificate(helper / "cert.pem"));
  overwrite(helper / "permissions.p7s", wire::sign_text(*certificate, *sure(wire::load_key(helper / "key.pem")),
                                                        wire::permissions_text(full_grant(subject_of(helper)))));

  const auto sut = talker("helper", {"--raw", helper.string()});

  EXPECT_TRUE(sut->says("refused participant")) << sut->out();
}

class Roles : public Strangers {};

TEST_F(Roles, RobotsHearEachOtherInSmallAndLargeSamples) {
  Words large_a = secure(arm), large_b = secure(other_arm);
  // Beyond what one datagram holds: samples in fragments are encrypted, too.
  for (Words* words : {&large_a, &large_b}) words->insert(words->end(), {"--size", "300000"});

  const auto small = talker("small", secure(arm)), other_small = talker("other-small", secure(other_arm));
  const Peer large(folder, "large", large_a, {"rt/large"}, {}), hearer(folder, "hearer", large_b, {}, {"rt/large"});

  EXPECT_TRUE(small->gets(*other_small, kCommand));
  EXPECT_TRUE(other_small->gets(*small, kCommand, 10));
  EXPECT_TRUE(hearer.gets(large, "rt/large", 50)) << hearer.out().substr(0, 1000) << hearer.err();
  EXPECT_TRUE(hearer.holds("got rt/large large 300000"));
}

TEST_F(Roles, WorkerDoesItsPoolTopicsAndNoOthers) {
  const fs::path helper = lab.issue("helper", Role::kWorker);
  Peer robot(folder, "robot", secure(arm), {kAssignment, kCommand, kElsewhere},
             {kResult, kHeartbeat, kCommand, kElsewhere});
  Peer other(folder, "other", secure(other_arm), {kCommand, kElsewhere}, {});
  Peer worker(folder, "worker", secure(helper), {kResult, kHeartbeat, kCommand, kElsewhere, kAssignment},
              {kAssignment, kCommand, kElsewhere});
  ASSERT_TRUE(worker.is_ready()) << worker.out() << worker.err();

  for (const std::string& topic : {kCommand, kElsewhere, kAssignment})
    EXPECT_TRUE(worker.holds("refused writer " + topic));
  for (const std::string& topic : {kCommand, kElsewhere}) EXPECT_TRUE(worker.holds("refused reader " + topic));
  EXPECT_TRUE(worker.gets(robot, kAssignment)) << worker.out() << worker.err();
  for (const std::string& topic : {kResult, kHeartbeat}) EXPECT_TRUE(robot.gets(worker, topic, 10)) << topic;
  for (const std::string& topic : {kCommand, kElsewhere}) {
    EXPECT_TRUE(robot.gets(other, topic, 10)) << topic;
    EXPECT_EQ(robot.count("worker", topic), 0) << topic;
    EXPECT_EQ(worker.count("robot", topic) + worker.count("other", topic), 0) << topic;
  }
}

// A worker whose own side lets it do what its permissions do not: with a governance that
// leaves robots' topics open. The robots judge by their own governance and its permissions.
TEST_F(Roles, WorkerThatDisarmsItsOwnSideIsStillRefusedByRobots) {
  const fs::path helper = lab.issue("helper", Role::kWorker);
  const wire::Authority rogue =
      wire::make_authority("Rogue", {std::time(nullptr) - 86'400, std::time(nullptr) + 86'400});
  const std::string both =
      folder.write("both.pem", contents(lab.folder() / "ca" / "ca.pem") + wire::to_pem(*rogue.certificate));
  std::string governance = wire::governance_text();
  const std::size_t begin = governance.find("<topic_rule>"), end = governance.find("</topic_access_rules>");
  std::string open = governance.substr(begin, end - begin);
  const auto change = [](std::string& text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
  };
  change(open, "<topic_expression>*<", "<topic_expression>rt/robot/*<");
  change(open, "read_access_control>true<", "read_access_control>false<");
  change(open, "write_access_control>true<", "write_access_control>false<");
  governance.insert(begin, open);
  overwrite(helper / "governance.p7s", wire::sign_text(*rogue.certificate, *rogue.key, governance));

  Peer robot(folder, "robot", secure(arm), {kAssignment, kCommand}, {kResult, kCommand});
  Peer other(folder, "other", secure(other_arm), {kCommand}, {});
  Peer worker(folder, "worker", {"--raw", helper.string(), "--permissions-ca", both}, {kResult, kCommand},
              {kAssignment, kCommand});
  ASSERT_TRUE(worker.is_ready()) << worker.out() << worker.err();
  EXPECT_THAT(worker.out(), Not(HasSubstr("refused")));

  EXPECT_TRUE(robot.gets(worker, kResult)) << robot.out() << robot.err();
  EXPECT_TRUE(worker.gets(robot, kAssignment, 10));
  EXPECT_TRUE(robot.gets(other, kCommand, 10));
  EXPECT_EQ(robot.count("worker", kCommand), 0);
  EXPECT_EQ(worker.count("robot", kCommand) + worker.count("other", kCommand), 0);
}

TEST_F(Roles, ObserverHearsEverythingAndSaysNothing) {
  Peer robot(folder, "robot", secure(arm), {kCommand, kAssignment, kElsewhere}, {kCommand});
  Peer observer(folder, "observer", secure(lab.issue("recorder", Role::kObserver)), {kCommand, kResult},
                {kCommand, kAssignment, kElsewhere});
  ASSERT_TRUE(observer.is_ready()) << observer.out() << observer.err();

  for (const std::string& topic : {kCommand, kResult}) EXPECT_TRUE(observer.holds("refused writer " + topic));
  for (const std::string& topic : {kCommand, kAssignment, kElsewhere})
    EXPECT_TRUE(observer.gets(robot, topic, 10)) << topic;
}

TEST_F(Roles, ServerJoinsAndSaysAndHearsNothing) {
  Peer server(folder, "server", secure(lab.issue("meeting-point", Role::kServer)), {kCommand, kResult},
              {kCommand, kAssignment});

  ASSERT_TRUE(server.is_ready()) << server.out() << server.err();

  for (const std::string& topic : {kCommand, kResult}) EXPECT_TRUE(server.holds("refused writer " + topic));
  for (const std::string& topic : {kCommand, kAssignment}) EXPECT_TRUE(server.holds("refused reader " + topic));
}

}  // namespace
}  // namespace jostle::tests
