#include "services/tools/doctor/facts.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>

#include "idl/types/hash.hpp"
#include "tests/support/forgery.hpp"

namespace jostle::tools {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

const std::vector<Check> kChecks{{"cores", Verdict::kOk, "2 cores", ""},
                                 {"multicast lo", Verdict::kWarn, "a datagram was late", "wait"},
                                 {"worker", Verdict::kFail, "it is missing", "build it"}};

// Of the environment that facts_of reads nothing is set, whatever the tests are run in.
class DoctorFacts : public testing::Test {
 protected:
  DoctorFacts() {
    unsetenv("JOSTLE_DISCOVERY");
    unsetenv("JOSTLE_SECURE");
  }
  ~DoctorFacts() override {
    unsetenv("JOSTLE_DISCOVERY");
    unsetenv("JOSTLE_SECURE");
  }
};

void expect_equal(const std::vector<Check>& got, const std::vector<Check>& wanted) {
  ASSERT_EQ(got.size(), wanted.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].name, wanted[i].name);
    EXPECT_EQ(got[i].verdict, wanted[i].verdict);
    EXPECT_EQ(got[i].finding, wanted[i].finding);
    EXPECT_EQ(got[i].remedy, wanted[i].remedy);
  }
}

TEST_F(DoctorFacts, AreOfThisProcessAndItsEnvironment) {
  char host[256] = "";
  gethostname(host, sizeof host - 1);

  const Facts facts = facts_of(7, kChecks);

  EXPECT_EQ(facts.host, host);
  EXPECT_THAT(facts.version, testing::MatchesRegex("[0-9]+[.][0-9]+[.][0-9]+"));
  EXPECT_EQ(facts.types.size(), 64u);  // SHA-256, hexadecimal
  EXPECT_EQ(facts.domain, 7);
  EXPECT_EQ(facts.discovery, "multicast");
  EXPECT_THAT(facts.identity, IsEmpty());
  EXPECT_THAT(facts.authority, IsEmpty());
  expect_equal(facts.checks, kChecks);
}

TEST_F(DoctorFacts, DiscoveryIsWhatTheEnvironmentSays) {
  setenv("JOSTLE_DISCOVERY", "server:10.0.0.1", 1);
  EXPECT_EQ(facts_of(0, {}).discovery, "server:10.0.0.1");
  setenv("JOSTLE_DISCOVERY", "", 1);
  EXPECT_EQ(facts_of(0, {}).discovery, "multicast");
}

TEST_F(DoctorFacts, IdentityHasNameRoleAndAuthority) {
  const tests::TempFolder folder;
  const tests::Lab lab(folder.path() / "keys");
  const auto identity = lab.issue("left-arm", wire::Role::kRobot);
  setenv("JOSTLE_SECURE", identity.c_str(), 1);

  const Facts facts = facts_of(0, {});

  EXPECT_EQ(facts.identity, "left-arm (robot)");
  EXPECT_EQ(facts.authority, to_string(hash_of(tests::contents(identity / "ca.pem"))));
}

TEST_F(DoctorFacts, SurviveTheWayThere) {
  const Facts sent{.host = "left \"arm\"",
                   .version = "1.2.3",
                   .types = "abc",
                   .domain = 42,
                   .discovery = "peers:a,b",
                   .identity = "left-arm (robot)",
                   .authority = "def",
                   .checks = kChecks};

  const auto facts_result = parse_facts(nlohmann::json::parse(to_json(sent).dump()));

  ASSERT_TRUE(facts_result) << facts_result.error().message;
  EXPECT_EQ(facts_result->host, sent.host);
  EXPECT_EQ(facts_result->version, sent.version);
  EXPECT_EQ(facts_result->types, sent.types);
  EXPECT_EQ(facts_result->domain, sent.domain);
  EXPECT_EQ(facts_result->discovery, sent.discovery);
  EXPECT_EQ(facts_result->identity, sent.identity);
  EXPECT_EQ(facts_result->authority, sent.authority);
  expect_equal(facts_result->checks, sent.checks);
}

TEST_F(DoctorFacts, ThatLackAFieldOrHaveAnotherTypeAreAnErrorThatNamesIt) {
  const nlohmann::json good = to_json(facts_of(0, kChecks));
  for (const auto& [field, value] : good.items()) {
    nlohmann::json bad = good;
    bad.erase(field);
    const auto facts_result = parse_facts(bad);
    ASSERT_FALSE(facts_result) << field;
    EXPECT_EQ(facts_result.error().code, Code::kInvalidArgument);
    EXPECT_THAT(facts_result.error().message, HasSubstr("facts of the other doctor"));
    EXPECT_THAT(facts_result.error().message, HasSubstr("'" + field + "'"));
  }
  const std::pair<const char*, nlohmann::json> cases[] = {
      {"host", 7}, {"domain", "seven"}, {"domain", nullptr}, {"checks", {1, 2}}, {"checks", {{{"name", "x"}}}}};
  for (const auto& [field, value] : cases) {
    nlohmann::json bad = good;
    bad[field] = value;
    EXPECT_FALSE(parse_facts(bad)) << field << " " << value;
  }
  for (const char* text : {"null", "[]", "1", "{}", "\"facts\""}) {
    EXPECT_FALSE(parse_facts(nlohmann::json::parse(text))) << text;
  }
}

TEST_F(DoctorFacts, VerdictThatNobodyKnowsIsAFailure) {
  nlohmann::json facts = to_json(facts_of(0, kChecks));
  facts["checks"][0]["verdict"] = "splendid";
  const auto facts_result = parse_facts(facts);
  ASSERT_TRUE(facts_result);
  EXPECT_EQ(facts_result->checks[0].verdict, Verdict::kFail);
}

TEST(DoctorWord, IsOneForEachVerdict) {
  EXPECT_STREQ(word(Verdict::kOk), "ok");
  EXPECT_STREQ(word(Verdict::kWarn), "warn");
  EXPECT_STREQ(word(Verdict::kFail), "FAIL");
}

TEST(DoctorClock, IsTheWallClock) {
  const auto now = [] { return std::chrono::system_clock::now().time_since_epoch(); };
  const auto before = now();
  const std::chrono::nanoseconds sut(wall_clock_ns());
  EXPECT_GE(sut, before);
  EXPECT_LE(sut, now());
}

TEST(DoctorDatagram, IsTheTextFilledUpToWhatUdpCarries) {
  EXPECT_EQ(test_datagram("knock", 8), "knock...");
  EXPECT_EQ(test_datagram("knock", 5), "knock");
  EXPECT_EQ(test_datagram("knock", 0), "knock");
  EXPECT_EQ(test_datagram("knock", 65'507).size(), 65'507u);
  EXPECT_EQ(test_datagram("knock", 1 << 20).size(), 65'507u);
  EXPECT_EQ(test_datagram("", 2), "..");
}

}  // namespace
}  // namespace jostle::tools
