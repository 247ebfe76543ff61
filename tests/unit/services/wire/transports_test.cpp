#include "services/wire/dds/transports.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <gmock/gmock.h>

#include <cstdlib>

namespace jostle::wire {
namespace {

using eprosima::fastdds::dds::DomainParticipantQos;
using eprosima::fastdds::rtps::SharedMemTransportDescriptor;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kDomain = 5;

DomainParticipantQos with_segment(std::uint32_t bytes) {
  DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  const auto memory = std::make_shared<SharedMemTransportDescriptor>();
  memory->segment_size(bytes);
  qos.transport().user_transports.push_back(memory);
  return qos;
}

TEST(SharedMemoryRoom, IsNotLookedForWithoutSharedMemory) {
  DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(std::make_shared<UDPv4TransportDescriptor>());
  EXPECT_FALSE(uses_shared_memory(qos));
  EXPECT_THAT(SharedMemoryRoom(qos, kDomain, "/nowhere").why_not(), IsEmpty());
}

TEST(SharedMemoryRoom, SaysWhyThereIsNone) {
  const auto qos = with_segment(1 << 20);
  EXPECT_THAT(SharedMemoryRoom(qos, kDomain, "/nowhere").why_not(), HasSubstr("/nowhere: No such file"));
  EXPECT_THAT(SharedMemoryRoom(qos, kDomain, "/proc/self").why_not(), HasSubstr("/proc/self: "));
}

TEST(SharedMemoryRoom, CountsEverySegment) {
  auto qos = with_segment(UINT32_MAX);
  while (qos.transport().user_transports.size() < 4096)  // 16 TiB
    qos.transport().user_transports.push_back(qos.transport().user_transports.front());
  EXPECT_THAT(SharedMemoryRoom(qos, kDomain).why_not(), HasSubstr("no room for "));
}

TEST(SharedMemoryRoom, IsTheMiddlewaresOwnChoiceToo) {
  const DomainParticipantQos qos;
  EXPECT_TRUE(uses_shared_memory(qos));
  EXPECT_THAT(SharedMemoryRoom(qos, kDomain).why_not(), IsEmpty());
}

TEST(Transports, BecomeUdpWhereSharedMemoryIsLeftOut) {
  for (DomainParticipantQos qos : {DomainParticipantQos(), with_segment(1 << 20)}) {
    use_udp_instead(qos);
    EXPECT_FALSE(uses_shared_memory(qos));
    ASSERT_EQ(qos.transport().user_transports.size(), 1u);
    EXPECT_TRUE(std::dynamic_pointer_cast<UDPv4TransportDescriptor>(qos.transport().user_transports.front()));
  }
}

TEST(Transports, StayOnThisMachineAsCopies) {
  const auto original = std::make_shared<UDPv4TransportDescriptor>();
  DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(original);
  keep_on_this_machine(qos);
  const auto udp = std::dynamic_pointer_cast<UDPv4TransportDescriptor>(qos.transport().user_transports.front());
  ASSERT_TRUE(udp);
  EXPECT_THAT(udp->interfaceWhiteList, ElementsAre("127.0.0.1"));
  EXPECT_THAT(original->interfaceWhiteList, IsEmpty());
}

TEST(HiddenVariables, AreBackAtTheEnd) {
  setenv("ROS_DISCOVERY_SERVER", "10.0.0.1", 1);
  {
    const HiddenVariables sut;
    EXPECT_EQ(std::getenv("ROS_DISCOVERY_SERVER"), nullptr);
  }
  EXPECT_STREQ(std::getenv("ROS_DISCOVERY_SERVER"), "10.0.0.1");
  unsetenv("ROS_DISCOVERY_SERVER");
  { const HiddenVariables sut; }
  EXPECT_EQ(std::getenv("ROS_DISCOVERY_SERVER"), nullptr);
}

}  // namespace
}  // namespace jostle::wire
