#include "services/wire/dds/endpoint_watch.hpp"

#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <mutex>
#include <utility>
#include <vector>

#include "services/wire/dds/core.hpp"

namespace jostle::wire {
namespace {

using namespace eprosima::fastrtps::rtps;

// Reads a writer's or a reader's announcement; they have the same words for these.
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

  void report(const Endpoint& endpoint, bool gone) {
    const std::lock_guard lock(mutex);  // nothing overtakes what was held back
    if (holds) {
      held.emplace_back(endpoint, gone);
    } else {
      tell(endpoint, gone);
    }
  }

  void tell(const Endpoint& endpoint, bool gone) const {
    const OnEndpoint& call = gone ? on_gone : on_found;
    if (call) call(endpoint);
  }

  OnEndpoint on_found, on_gone;
  std::mutex mutex;  // guards the two below, and is held while they call
  bool holds = false;
  std::vector<std::pair<Endpoint, bool>> held;  // with whether it went
};

EndpointWatch::EndpointWatch(OnEndpoint on_found, OnEndpoint on_gone) : impl_(std::make_unique<Impl>()) {
  impl_->on_found = std::move(on_found);
  impl_->on_gone = std::move(on_gone);
}

EndpointWatch::~EndpointWatch() = default;

eprosima::fastdds::dds::DomainParticipantListener& EndpointWatch::listener() { return *impl_; }

void EndpointWatch::hold() {
  const std::lock_guard lock(impl_->mutex);
  impl_->holds = true;
}

void EndpointWatch::let_go(bool tell) {
  const std::lock_guard lock(impl_->mutex);
  impl_->holds = false;
  for (const auto& [endpoint, gone] : std::exchange(impl_->held, {})) {
    if (tell) impl_->tell(endpoint, gone);
  }
}

}  // namespace jostle::wire
