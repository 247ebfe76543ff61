#include "services/wire/dds/guard.hpp"

#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>
#include <fastdds/rtps/transport/UDPTransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <algorithm>
#include <memory>

#include "services/common/process/trouble.hpp"
#include "services/wire/dds/datagrams.hpp"

namespace jostle::wire {
namespace {

using namespace eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorsIterator;
using eprosima::fastrtps::rtps::octet;
using eprosima::fastrtps::rtps::SenderResource;

class GuardedTransport final : public ChainingTransport {
 public:
  using ChainingTransport::ChainingTransport;

  // As if we were not there. The middleware's own chain hides from the transport below which of its sockets are open,
  // and it would open one more for every peer.
  bool OpenOutputChannel(SendResourceList& sockets, const Locator_t& locator) override {
    return low_level_transport_->OpenOutputChannel(sockets, locator);
  }

  // Never called, for the same reason.
  bool send(SenderResource* below, const octet* data, std::uint32_t size, LocatorsIterator* begin,
            LocatorsIterator* end, const std::chrono::steady_clock::time_point& deadline) override {
    return below->send(data, size, begin, end, deadline);
  }

  void receive(TransportReceiverInterface* next, const octet* data, std::uint32_t size, const Locator_t& local,
               const Locator_t& remote) override {
    const Flaw flaw = judge_.judge({data, size}, IPLocator::getPhysicalPort(remote), std::chrono::steady_clock::now());
    if (flaw == Flaw::kNone) return next->OnDataReceived(data, size, local, remote);
    dropped_.warn("a datagram of {} bytes from {} was dropped: {}", size, IPLocator::ip_to_string(remote),
                  to_string(flaw));
  }

  TransportDescriptorInterface* get_configuration() override { return low_level_transport_->get_configuration(); }

  void shutdown() override { low_level_transport_->shutdown(); }

 private:
  Judge judge_;
  common::Trouble dropped_{"datagrams were dropped"};
};

struct GuardDescriptor final : ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;

  TransportInterface* create_transport() const override { return new GuardedTransport(*this); }
};

// The middleware makes these where it is left to itself.
void name_builtin_transports(eprosima::fastdds::dds::TransportConfigQos& transport) {
  const auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->sendBufferSize = transport.send_socket_buffer_size;
  udp->receiveBufferSize = transport.listen_socket_buffer_size;
  const auto memory = std::make_shared<SharedMemTransportDescriptor>();
  memory->segment_size(2 * std::max(udp->sendBufferSize, udp->receiveBufferSize));
  memory->max_message_size(udp->max_message_size());
  transport.user_transports.push_back(udp);
  transport.user_transports.push_back(memory);
  transport.use_builtin_transports = false;
}

}  // namespace

void guard(eprosima::fastdds::dds::DomainParticipantQos& qos) {
  auto& transport = qos.transport();
  if (transport.use_builtin_transports) name_builtin_transports(transport);
  for (auto& descriptor : transport.user_transports) {
    if (std::dynamic_pointer_cast<UDPTransportDescriptor>(descriptor)) {
      descriptor = std::make_shared<GuardDescriptor>(descriptor);
    }
  }
}

}  // namespace jostle::wire
