#include "services/wire/dds/joining.hpp"

#include <algorithm>
#include <condition_variable>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

namespace jostle::wire {
namespace {

using namespace eprosima::fastrtps::rtps;
using eprosima::fastdds::dds::DomainParticipant;
using eprosima::fastdds::dds::DomainParticipantFactory;
using eprosima::fastdds::dds::DomainParticipantQos;
using Listener = eprosima::fastdds::dds::DomainParticipantListener;

// Keeps the directory, and knows who came with an identity, and who of them was let in or turned away. Endpoints are
// the watch's.
class Doorkeeper final : public Listener {
 public:
  explicit Doorkeeper(std::shared_ptr<EndpointWatch> watch) : watch_(std::move(watch)) {}

  void on_participant_discovery(DomainParticipant*, ParticipantDiscoveryInfo&& info) override {
    const bool gone = info.status == ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
                      info.status == ParticipantDiscoveryInfo::DROPPED_PARTICIPANT;
    gone ? directory_->remove(info.info.m_guid) : directory_->add(info.info);
    const std::lock_guard lock(mutex_);
    if (gone) {
      came_.erase(info.info.m_guid);
      judged_.erase(info.info.m_guid);
    } else if (!info.info.identity_token_.class_id().empty()) {
      came_.insert(info.info.m_guid);
    }
    changed_.notify_all();
  }

  void onParticipantAuthentication(DomainParticipant*, ParticipantAuthenticationInfo&& info) override {
    const std::lock_guard lock(mutex_);
    judged_.insert(info.guid);
    changed_.notify_all();
  }

  void on_publisher_discovery(DomainParticipant* self, WriterDiscoveryInfo&& info) override {
    if (watch_) watch_->listener().on_publisher_discovery(self, std::move(info));
  }

  void on_subscriber_discovery(DomainParticipant* self, ReaderDiscoveryInfo&& info) override {
    if (watch_) watch_->listener().on_subscriber_discovery(self, std::move(info));
  }

  const std::shared_ptr<Directory>& directory() const { return directory_; }

  // Whether it knows by then what to think of everybody who came.
  bool knows_all_by(std::chrono::steady_clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    // Either callback of a participant may come first.
    return changed_.wait_until(lock, deadline, [this] {
      return std::ranges::all_of(came_, [this](const GUID_t& guid) { return judged_.contains(guid); });
    });
  }

 private:
  const std::shared_ptr<EndpointWatch> watch_;
  const std::shared_ptr<Directory> directory_ = std::make_shared<Directory>();
  std::mutex mutex_;  // guards the sets
  std::condition_variable changed_;
  std::set<GUID_t> came_, judged_;
};

bool is_protected(const DomainParticipantQos& qos) {
  return eprosima::fastrtps::rtps::PropertyPolicyHelper::find_property(qos.properties(), "dds.sec.auth.plugin");
}

DomainParticipant* create(int domain, const DomainParticipantQos& qos, Listener* listener) {
  return DomainParticipantFactory::get_instance()->create_participant(static_cast<std::uint32_t>(domain), qos, listener,
                                                                      eprosima::fastdds::dds::StatusMask::none());
}

}  // namespace

Joined join(int domain, const DomainParticipantQos& qos, const std::shared_ptr<EndpointWatch>& watch) {
  if (!is_protected(qos)) {
    const auto door = std::make_shared<Doorkeeper>(watch);
    return {door, door->directory(), create(domain, qos, door.get())};
  }
  for (bool is_first = true;; is_first = false) {
    const auto door = std::make_shared<Doorkeeper>(watch);
    if (watch) watch->hold();
    const auto start = std::chrono::steady_clock::now();
    DomainParticipant* participant = create(domain, qos, door.get());
    if (!participant) return {};
    std::this_thread::sleep_until(start + kHail);
    const bool stays = !is_first || door->knows_all_by(start + kHail + kPatience);
    if (!stays) DomainParticipantFactory::get_instance()->delete_participant(participant);
    if (watch) watch->let_go(stays);
    if (stays) return {door, door->directory(), participant};
  }
}

}  // namespace jostle::wire
