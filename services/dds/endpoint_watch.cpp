#include "services/dds/endpoint_watch.hpp"

#include <fastdds/dds/domain/DomainParticipantListener.hpp>

#include "services/dds/core.hpp"

namespace jostle::dds {
namespace {

using namespace eprosima::fastrtps::rtps;

// Of a writer's or a reader's announcement, which have the same words for these.
template <class ProxyData>
Endpoint describe(Endpoint::Kind kind, const ProxyData& data) {
  return {.kind = kind,
          .guid = to_guid(data.guid()),
          .topic = data.topicName().to_string(),
          .type = data.typeName().to_string(),
          .keyed = data.topicKind() == WITH_KEY,
          .reliable = data.m_qos.m_reliability.kind == eprosima::fastdds::dds::RELIABLE_RELIABILITY_QOS,
          .latched = data.m_qos.m_durability.kind >= eprosima::fastdds::dds::TRANSIENT_LOCAL_DURABILITY_QOS};
}

}  // namespace

struct EndpointWatch::Impl : eprosima::fastdds::dds::DomainParticipantListener {
  void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant* self, WriterDiscoveryInfo&& info) override {
    if (is_own(*self, info.info.guid())) return;
    report(describe(Endpoint::Kind::kWriter, info.info), info.status == WriterDiscoveryInfo::REMOVED_WRITER);
  }

  void on_subscriber_discovery(eprosima::fastdds::dds::DomainParticipant* self, ReaderDiscoveryInfo&& info) override {
    if (is_own(*self, info.info.guid())) return;
    report(describe(Endpoint::Kind::kReader, info.info), info.status == ReaderDiscoveryInfo::REMOVED_READER);
  }

  // The middleware tells of its own endpoints, too.
  static bool is_own(const eprosima::fastdds::dds::DomainParticipant& self, const GUID_t& endpoint) {
    return self.guid().guidPrefix == endpoint.guidPrefix;
  }

  void report(const Endpoint& endpoint, bool gone) const {
    const OnEndpoint& tell = gone ? on_gone : on_found;
    if (tell) tell(endpoint);
  }

  OnEndpoint on_found, on_gone;
};

EndpointWatch::EndpointWatch(OnEndpoint on_found, OnEndpoint on_gone) : impl_(std::make_unique<Impl>()) {
  impl_->on_found = std::move(on_found);
  impl_->on_gone = std::move(on_gone);
}

EndpointWatch::~EndpointWatch() = default;

eprosima::fastdds::dds::DomainParticipantListener& EndpointWatch::listener() { return *impl_; }

}  // namespace jostle::dds
