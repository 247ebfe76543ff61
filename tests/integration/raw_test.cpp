// Samples as bytes: what typed programs send and take, and who is out there.

#include <gmock/gmock.h>

#include <mutex>
#include <set>

#include "services/wire/dds/endpoint_watch.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace jostle_msgs::msg;
using ::testing::ElementsAre;

const wire::RawTopic kStatus{"rt/robot/status", "jostle_msgs::msg::dds_::RobotStatus_", kState};
const wire::RawTopic kNumbers{"rt/numbers", "test_msgs::msg::dds_::Number_", kCommand};

std::vector<std::byte> number(std::uint8_t value) {
  return {std::byte{0},     std::byte{1}, std::byte{0}, std::byte{0},
          std::byte{value}, std::byte{0}, std::byte{0}, std::byte{0}};
}

// Keeps what a raw reader gets.
class Heap {
 public:
  void put(std::span<const std::byte> bytes, const wire::Origin& origin) {
    const std::lock_guard lock(mutex_);
    samples_.emplace_back(bytes.begin(), bytes.end());
    origins_.push_back(origin);
  }
  std::vector<std::vector<std::byte>> samples() const {
    const std::lock_guard lock(mutex_);
    return samples_;
  }
  std::vector<wire::Origin> origins() const {
    const std::lock_guard lock(mutex_);
    return origins_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::vector<std::byte>> samples_;
  std::vector<wire::Origin> origins_;
};

class Raw : public RunFixture {
 protected:
  Raw() {
    const auto note = [this](std::set<std::string>& names) {
      return [this, &names](const wire::Endpoint& endpoint) {
        const std::lock_guard lock(mutex);
        const auto type = wire::ros_type(endpoint.type);
        names.insert(fmt::format("{} {} {}{}{}{}", endpoint.kind == wire::Endpoint::Kind::kWriter ? "writes" : "reads",
                                 wire::ros_topic(endpoint.topic).value_or(endpoint.topic), type.value_or(endpoint.type),
                                 endpoint.keyed ? " keyed" : "", endpoint.reliable ? " reliable" : "",
                                 endpoint.latched ? " latched" : ""));
      };
    };
    watch = std::make_shared<wire::EndpointWatch>(note(found), note(gone));
    participant.emplace(wire::Participant::open({.domain = domain, .watch = watch}).value());
  }

  bool has(const std::set<std::string>& names, const std::string& name) const {
    return soon(kPatience, [&] {
      const std::lock_guard lock(mutex);
      return names.contains(name);
    });
  }

  mutable std::mutex mutex;  // guards found and gone
  std::set<std::string> found, gone;
  std::shared_ptr<wire::EndpointWatch> watch;
  std::optional<wire::Participant> participant;
};

TEST_F(Raw, ReaderGetsTheBytesOfATypedWriter) {
  Heap heap;
  const wire::RawReader sut(*participant, kStatus, [&](auto bytes, const auto& origin) { heap.put(bytes, origin); });
  const auto sim = program("jostle_sim", {easy});
  ASSERT_TRUE(soon(kPatience, [&] { return heap.samples().size() >= 3; })) << sim->err();

  std::vector<std::byte> bytes = heap.samples().front();
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::memcpy(payload.data, bytes.data(), bytes.size());
  payload.length = payload.max_size;
  RobotStatus status;
  ASSERT_TRUE(wire::Serializer<RobotStatus>().deserialize(&payload, &status));
  EXPECT_FALSE(status.q().empty());
  EXPECT_EQ(status.q().size(), status.v().size());
  const auto origins = heap.origins();
  EXPECT_EQ(origins[1].sequence, origins[0].sequence + 1);
  EXPECT_EQ(origins[1].writer, origins[0].writer);
  EXPECT_EQ(sut.matched_participants(), std::vector{origins[0].participant});
  const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
  EXPECT_NEAR(static_cast<double>(origins[0].source_time), static_cast<double>(now.count()), 60e9);
}

TEST_F(Raw, WriterReachesATypedReader) {
  VelocityCommand command;
  command.epoch(5);
  command.sequence_number(1);
  command.velocities({0.05, 0.0, 0.0, 0.0});
  command.duration(0.2);
  wire::Serializer<VelocityCommand> serializer;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(serializer.getSerializedSizeProvider(&command)());
  ASSERT_TRUE(serializer.serialize(&command, &payload));
  wire::RawWriter sut(*participant, {"rt/robot/command", serializer.getName(), kCommand});
  wire::Inbox<RobotStatus> statuses(*participant, wire::topics::kRobotStatus, 64);
  const auto sim = program("jostle_sim", {easy});
  ASSERT_TRUE(sut.wait_for_readers(in(kPatience)));

  ASSERT_TRUE(sut.write({reinterpret_cast<const std::byte*>(payload.data), payload.length}));

  const auto end = in(kPatience);
  auto status = statuses.take(end);
  while (status && status->sequence_number() != 1) status = statuses.take(end);
  EXPECT_TRUE(status) << sim->err();
}

TEST_F(Raw, RetainedSamplesComeToALateReaderInOrder) {
  wire::RawWriter writer(*participant, kNumbers);
  for (std::uint8_t i = 1; i <= 3; ++i) ASSERT_TRUE(writer.write(number(i)));
  EXPECT_FALSE(writer.write({}));
  Heap heap;

  const wire::RawReader sut(*participant, {kNumbers.name, kNumbers.type, {.latched = true, .depth = kKeepAll}},
                            [&](auto bytes, const auto& origin) { heap.put(bytes, origin); });

  ASSERT_TRUE(soon(kPatience, [&] { return heap.samples().size() == 3; }));
  EXPECT_THAT(heap.samples(), ElementsAre(number(1), number(2), number(3)));
  EXPECT_TRUE(writer.wait_until_received(in(kPatience)));
}

TEST_F(Raw, ReaderCountsWritersThatOfferTooLittle) {
  const wire::RawWriter writer(*participant, {kNumbers.name, kNumbers.type, {}});
  const wire::RawReader sut(*participant, {kNumbers.name, kNumbers.type, {.latched = true, .depth = kKeepAll}},
                            [](auto, const auto&) {});

  EXPECT_TRUE(soon(kPatience, [&] { return sut.troubles().incompatible == 1; }));
  EXPECT_EQ(sut.troubles().lost, 0u);
  EXPECT_EQ(sut.troubles().rejected, 0u);
}

TEST_F(Raw, KeyedTypesAreTakenWhereTheKeyCanBeFound) {
  const std::string world = "jostle_msgs::msg::dds_::WorldDescription_";
  EXPECT_TRUE(wire::can_be_raw(world, true));
  EXPECT_FALSE(wire::can_be_raw(world, false));
  EXPECT_TRUE(wire::can_be_raw(kNumbers.type, false));
  EXPECT_FALSE(wire::can_be_raw(kNumbers.type, true));
  const auto run_of =
      program("jostle_run", {easy, "--parameters", plain, "--plan-only", "--headless", "--workers", "1"});
  Heap heap;
  const wire::RawReader sut(*participant, {wire::topics::kPoolWorld.name, world, wire::topics::kPoolWorld.qos},
                            [&](auto bytes, const auto& origin) { heap.put(bytes, origin); });

  EXPECT_TRUE(soon(kPatience, [&] { return !heap.samples().empty(); })) << run_of->err();
}

TEST_F(Raw, ATypeIsEitherRawOrTypedInAParticipant) {
  const wire::Writer<RobotStatus> typed(*participant, wire::topics::kRobotStatus);

  EXPECT_THROW(wire::RawReader(*participant, kStatus, [](auto, const auto&) {}), wire::SetupError);
}

TEST_F(Raw, WatchNamesEndpointsThatComeAndGo) {
  const auto sim = program("jostle_sim", {easy});

  EXPECT_TRUE(has(found, "writes /robot/status jostle_msgs/msg/RobotStatus reliable latched"));
  EXPECT_TRUE(has(found, "reads /robot/command jostle_msgs/msg/VelocityCommand reliable"));
  sim->signal(SIGTERM);
  EXPECT_TRUE(has(gone, "writes /robot/status jostle_msgs/msg/RobotStatus reliable latched"));
}

}  // namespace
}  // namespace jostle::tests
