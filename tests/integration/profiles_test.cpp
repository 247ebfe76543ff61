// The file of transports and QoS: the one that is installed says what the code says, an edited
// one is in force, a broken one is named with its line.

#include <gmock/gmock.h>
#include <sys/socket.h>

#include <algorithm>

#include "services/wire/dds/core.hpp"
#include "services/wire/dds/profiles.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "tests/support/cramped_writer.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace eprosima::fastdds::dds;
using eprosima::fastdds::rtps::SharedMemTransportDescriptor;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::filesystem::path kShipped = JOSTLE_SOURCE_DIR "/deploy/profiles.xml";

// The shipped file with the n-th `before` made `after`, and the line where that happened.
struct Edited {
  std::string text;
  int line = 0;
};

Edited edit(const std::string& before, const std::string& after, int n = 1) {
  std::string text = contents(kShipped);
  std::size_t at = std::string::npos;
  for (int i = 0; i < n; ++i) at = text.find(before, at + 1);
  if (at == std::string::npos) throw std::logic_error("not in the shipped file: " + before);
  const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
  return {text.replace(at, before.size(), after), static_cast<int>(line)};
}

class Profiles : public ::testing::Test {
 protected:
  void load(const std::string& text) {
    const auto ok = wire::load_profiles({.path = folder.write("edited.xml", text)});
    ASSERT_TRUE(ok) << ok.error().message;
  }
  ~Profiles() override { EXPECT_TRUE(wire::load_profiles({.path = kShipped})); }

  const int domain = test_domain();
  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  const TempFolder folder;
};

TEST_F(Profiles, ShippedOnesOfTopicsSayWhatTheCodeSays) {
  for (const Qos& kind : kKinds) {
    SCOPED_TRACE(kind.kind);
    const std::string name(kind.kind);
    DataWriterQos writer, writer_in_file;
    wire::apply_to_writer(kind, writer);
    ASSERT_EQ(participant.core().publisher->get_datawriter_qos_from_profile(name, writer_in_file),
              ReturnCode_t::RETCODE_OK);
    EXPECT_TRUE(writer_in_file == writer);

    DataReaderQos reader, reader_in_file;
    wire::apply_to_reader(kind, reader);
    ASSERT_EQ(participant.core().subscriber->get_datareader_qos_from_profile(name, reader_in_file),
              ReturnCode_t::RETCODE_OK);
    EXPECT_TRUE(reader_in_file == reader);
  }
}

TEST_F(Profiles, ShippedOnesOfParticipantsSayWhatTheCodeSays) {
  for (const std::string name : {"udp", "shared_memory"}) {
    SCOPED_TRACE(name);
    DomainParticipantQos built_in = wire::built_in_participant(name).value(), in_file;
    ASSERT_EQ(DomainParticipantFactory::get_instance()->get_participant_qos_from_profile(name, in_file),
              ReturnCode_t::RETCODE_OK);
    auto &transports = built_in.transport().user_transports, &in_file_transports = in_file.transport().user_transports;
    ASSERT_EQ(in_file_transports.size(), transports.size());
    for (std::size_t i = 0; i < transports.size(); ++i) {
      if (const auto udp = std::dynamic_pointer_cast<UDPv4TransportDescriptor>(transports[i])) {
        const auto other = std::dynamic_pointer_cast<UDPv4TransportDescriptor>(in_file_transports[i]);
        ASSERT_TRUE(other);
        EXPECT_TRUE(*other == *udp);
      } else {
        const auto memory = std::dynamic_pointer_cast<SharedMemTransportDescriptor>(transports[i]);
        const auto other_memory = std::dynamic_pointer_cast<SharedMemTransportDescriptor>(in_file_transports[i]);
        ASSERT_TRUE(memory && other_memory);
        EXPECT_TRUE(*other_memory == *memory);
      }
    }
    // Else the same, pointers and names apart.
    transports.clear();
    in_file_transports.clear();
    in_file.name(built_in.name());
    EXPECT_TRUE(in_file == built_in);
  }
}

TEST_F(Profiles, EveryTopicIsOfAKindThatTheFileHas) {
  const auto has = [](const Qos& qos) { return std::ranges::find(kKinds, qos.kind, &Qos::kind) != kKinds.end(); };
  EXPECT_TRUE(has(wire::topics::kTaskGoal.qos) && has(wire::topics::kTaskResult.qos) &&
              has(wire::topics::kRobotStatus.qos) && has(wire::topics::kPoolWorld.qos) &&
              has(wire::topics::pool_assignment(1).qos));
}

TEST_F(Profiles, BuffersAreThoseThatTheSysctlFileSets) {
  const std::string sysctl = contents(JOSTLE_SOURCE_DIR "/deploy/sysctl/60-jostle.conf");
  const auto udp = std::dynamic_pointer_cast<UDPv4TransportDescriptor>(
      wire::built_in_participant("udp")->transport().user_transports.front());
  EXPECT_THAT(sysctl, HasSubstr(fmt::format("net.core.rmem_max = {}\n", udp->receiveBufferSize)));
  EXPECT_THAT(sysctl, HasSubstr(fmt::format("net.core.wmem_max = {}\n", udp->sendBufferSize)));
}

// The ids of what a late reader of a latched topic gets of samples "0" to "4".
std::vector<std::string> kept_of_five(const wire::Participant& participant) {
  wire::Writer<jostle_msgs::msg::GoalResult> writer(participant, wire::topics::kTaskResult);
  for (int i = 0; i < 5; ++i) {
    jostle_msgs::msg::GoalResult result;
    result.goal_id(std::to_string(i));
    EXPECT_TRUE(writer.write(result));
  }
  wire::Inbox<jostle_msgs::msg::GoalResult> late(participant, wire::topics::kTaskResult, 100);
  std::vector<std::string> ids;
  while (ids.empty() || ids.back() != "4") {
    const auto result = late.take(in(10s));
    if (!result) break;
    ids.push_back(result->goal_id());
  }
  return ids;
}

TEST_F(Profiles, EditedDepthIsInForce) {
  EXPECT_THAT(kept_of_five(participant), ElementsAre("0", "1", "2", "3", "4"));

  load(edit("<depth>16</depth>", "<depth>2</depth>").text);  // the writer's

  EXPECT_THAT(kept_of_five(participant), ElementsAre("3", "4"));
}

TEST_F(Profiles, TopicOfItsOwnGoesBeforeItsKind) {
  const std::string own = R"(<data_writer profile_name="rt/task/result">
    <topic><historyQos><kind>KEEP_LAST</kind><depth>1</depth></historyQos></topic>
    <qos><reliability><kind>RELIABLE</kind></reliability><durability><kind>TRANSIENT_LOCAL</kind></durability></qos>
  </data_writer>
</profiles>)";

  load(edit("</profiles>", own).text);

  EXPECT_THAT(kept_of_five(participant), ElementsAre("4"));
}

// Receive buffers of this process's UDP sockets, bytes as the kernel counts them.
std::vector<int> receive_buffers() {
  std::vector<int> sizes;
  for (int socket = 0; socket < 1024; ++socket) {
    int type = 0, domain = 0, size = 0;
    socklen_t length = sizeof type;
    if (getsockopt(socket, SOL_SOCKET, SO_TYPE, &type, &length) != 0 || type != SOCK_DGRAM) continue;
    getsockopt(socket, SOL_SOCKET, SO_DOMAIN, &domain, &(length = sizeof domain));
    getsockopt(socket, SOL_SOCKET, SO_RCVBUF, &size, &(length = sizeof size));
    if (domain == AF_INET) sizes.push_back(size);
  }
  return sizes;
}

TEST_F(Profiles, EditedBufferSizeIsInForce) {
  load(edit("<receiveBufferSize>4194304</receiveBufferSize>", "<receiveBufferSize>100000</receiveBufferSize>").text);

  const auto before = receive_buffers();
  const auto other = wire::Participant::open({.domain = domain}).value();
  const auto with_other = receive_buffers();

  constexpr int kDoubled = 2 * 100000;  // socket(7): the kernel's own room included
  EXPECT_EQ(std::ranges::count(before, kDoubled), 0);
  EXPECT_GE(std::ranges::count(with_other, kDoubled), 1);
}

TEST_F(Profiles, SharedMemoryCarriesLargeSamples) {
  setenv("JOSTLE_DDS_TRANSPORT", "shared_memory", 1);
  const auto other = wire::Participant::open({.domain = domain});
  unsetenv("JOSTLE_DDS_TRANSPORT");
  ASSERT_TRUE(other) << other.error().message;
  wire::Inbox<jostle_msgs::msg::Goal> goals(*other, wire::topics::kTaskGoal, 1);
  wire::Writer<jostle_msgs::msg::Goal> writer(*other, wire::topics::kTaskGoal);
  jostle_msgs::msg::Goal goal;
  goal.execution_scene(std::string(1 << 20, 'x'));
  ASSERT_TRUE(writer.wait_for_readers(in(10s)));
  EXPECT_TRUE(writer.write(goal));
  const auto got = goals.take(in(10s));
  ASSERT_TRUE(got);
  EXPECT_EQ(got->execution_scene(), goal.execution_scene());
}

TEST_F(Profiles, MessageThatDoesNotFitIsSaidToBeLost) {
  load(edit("</profiles>", cramped_writer(wire::topics::kTaskGoal.name) + "</profiles>").text);
  wire::Writer<jostle_msgs::msg::Goal> writer(participant, wire::topics::kTaskGoal);
  jostle_msgs::msg::Goal goal;
  EXPECT_TRUE(writer.write(goal));
  goal.execution_scene(std::string(1 << 20, 'x'));
  EXPECT_FALSE(writer.write(goal));
}

TEST_F(Profiles, TransportThatNobodyDefinesIsRefused) {
  setenv("JOSTLE_DDS_TRANSPORT", "carrier_pigeon", 1);
  const auto result = wire::Participant::open({.domain = domain});
  unsetenv("JOSTLE_DDS_TRANSPORT");

  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message,
              HasSubstr("JOSTLE_DDS_TRANSPORT: got 'carrier_pigeon', wanted udp, shared_memory"));
}

struct Mistake {
  const char* name;
  const char *before, *after;
  const char* message;  // after "FILE:LINE: "
  int lines_later = 0;
};

class BrokenProfiles : public ::testing::TestWithParam<Mistake> {};

TEST_P(BrokenProfiles, AreNamedWithLineGotAndWanted) {
  const Mistake& mistake = GetParam();
  const TempFolder folder;
  const Edited edited = edit(mistake.before, mistake.after);
  const std::string file = folder.write("broken.xml", edited.text);

  const auto result = wire::load_profiles({.path = file});

  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message,
              HasSubstr(fmt::format("{}:{}: {}", file, edited.line + mistake.lines_later, mistake.message)));
  EXPECT_TRUE(wire::load_profiles({.path = kShipped})) << "one that is whole";
}

INSTANTIATE_TEST_SUITE_P(
    , BrokenProfiles,
    ::testing::Values(
        Mistake{"NoNumber", "<depth>512</depth>", "<depth>many</depth>", "<depth>: got 'many', wanted a whole number"},
        Mistake{"Nothing", "<depth>512</depth>", "<depth></depth>", "<depth>: got nothing, wanted a whole number"},
        Mistake{"NoDepth", "<depth>512</depth>", "<depth>0</depth>",
                "<data_writer>: got 'task', depth 0, wanted at least 1", -2},
        Mistake{"WrongKind", "<kind>RELIABLE</kind>", "<kind>SURE</kind>",
                "<kind>: got 'SURE', wanted RELIABLE or BEST_EFFORT"},
        Mistake{"WrongHistory", "<kind>KEEP_LAST</kind>", "<kind>KEEP_SOME</kind>",
                "<kind>: got 'KEEP_SOME', wanted KEEP_LAST or KEEP_ALL"},
        Mistake{"UnknownElement", "<depth>512</depth>", "<deepness>512</deepness>",
                "<deepness>: got '512', wanted what Fast DDS takes there"},
        Mistake{"BadBuffer", "<receiveBufferSize>4194304<", "<receiveBufferSize>4 MiB<",
                "<receiveBufferSize>: got '4 MiB', wanted a whole number"},
        Mistake{"BadSegment", "<segment_size>8388608<", "<segment_size>big<",
                "<segment_size>: got 'big', wanted a whole number"},
        Mistake{"BadTransport", "<type>UDPv4<", "<type>UDPv5<",
                "<type>: got 'UDPv5', wanted what Fast DDS takes there: Invalid transport type"},
        Mistake{"NoSuchTransport", "<transport_id>udp</transport_id></userTransports>",
                "<transport_id>tcp</transport_id></userTransports>", "<transport_id>: got 'tcp', wanted"},
        Mistake{"BadLease", "<sec>2<", "<sec>two<", "<sec>: got 'two', wanted"},
        Mistake{"UnknownKind", "profile_name=\"task\"", "profile_name=\"tsak\"",
                "<data_writer>: got 'tsak', wanted one of: task, command, answer, latched, stream, state, catalogue; "
                "or a topic"},
        Mistake{"Twice", "profile_name=\"answer\"", "profile_name=\"task\"",
                "<data_writer>: got 'task' again, wanted each name once"},
        Mistake{"NoName", " profile_name=\"task\"", "", "<data_writer>: got no name, wanted profile_name"},
        Mistake{"NeverMeet", "<kind>RELIABLE</kind>", "<kind>BEST_EFFORT</kind>",
                "<data_reader>: got 'task', readers RELIABLE and writers BEST_EFFORT, wanted no more from readers", 8},
        Mistake{"NoXml", "<times>", "<tims>", "got XML_ERROR_MISMATCHED_ELEMENT, wanted well-formed XML"}),
    [](const auto& mistake) { return mistake.param.name; });

// Two mistakes: the first is named.
TEST(BrokenProfilesOf, SeveralMistakesNameTheFirst) {
  const TempFolder folder;
  std::string text = contents(kShipped);
  int line = 0;
  for (std::size_t at = text.find("<depth>"), n = 0; at != std::string::npos; at = text.find("<depth>", at + 1), ++n) {
    if (n < 4) continue;
    text.replace(at, 8, "<depth>x");
    if (line == 0)
      line = 1 + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
  }
  const auto result = wire::load_profiles({.path = folder.write("broken.xml", text)});

  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr(fmt::format("broken.xml:{}: <depth>: got 'x", line)));
}

TEST(BrokenProfilesOf, AProgramEndItAsBadInput) {
  const TempFolder folder;
  const Edited edited = edit("<depth>512</depth>", "<depth>many</depth>");
  const std::string file = folder.write("broken.xml", edited.text);

  ProgramProcess worker("jostle_worker", {"--domain", std::to_string(test_domain())}, folder,
                        {{"JOSTLE_PROFILES", file}});

  EXPECT_EQ(worker.wait(10s), 2);
  EXPECT_THAT(worker.err() + worker.out(),
              HasSubstr(fmt::format("{}:{}: <depth>: got 'many', wanted a whole number", file, edited.line)));
}

TEST(MissingProfiles, AreNamed) {
  const auto result = wire::load_profiles({.path = "/nowhere/profiles.xml"});
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("/nowhere/profiles.xml: missing"));
}

}  // namespace
}  // namespace jostle::tests
