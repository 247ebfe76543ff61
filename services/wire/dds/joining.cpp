#include "services/wire/dds/joining.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "services/wire/dds/guard.hpp"
#include "services/wire/dds/transports.hpp"

namespace jostle::wire {
namespace {

using namespace eprosima::fastrtps::rtps;
using eprosima::fastdds::dds::DomainParticipant;
using eprosima::fastdds::dds::DomainParticipantFactory;
using eprosima::fastdds::dds::DomainParticipantQos;
using Listener = eprosima::fastdds::dds::DomainParticipantListener;

// Keeps the directory, and knows who came with an identity, who of them was let in or turned away, and who came
// without. Endpoints are the watch's.
class Guest final : public Doorkeeper {
 public:
  Guest(std::shared_ptr<EndpointWatch> watch, bool is_protected) : watch_(std::move(watch)), protected_(is_protected) {}

  int apart() const override {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(protected_ ? plain_.size() : came_.size());
  }

  void on_participant_discovery(DomainParticipant*, ParticipantDiscoveryInfo&& info) override {
    const bool gone = info.status == ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
                      info.status == ParticipantDiscoveryInfo::DROPPED_PARTICIPANT;
    gone ? directory_->remove(info.info.m_guid) : directory_->add(info.info);
    const std::lock_guard lock(mutex_);
    if (gone) {
      came_.erase(info.info.m_guid);
      judged_.erase(info.info.m_guid);
      plain_.erase(info.info.m_guid);
    } else {
      const bool has_identity = !info.info.identity_token_.class_id().empty();
      (has_identity ? came_ : plain_).insert(info.info.m_guid);
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
  const bool protected_;
  mutable std::mutex mutex_;  // guards the sets
  std::condition_variable changed_;
  std::set<GUID_t> came_, judged_;  // with an identity
  std::set<GUID_t> plain_;          // without
};

DomainParticipant* create_guarded(int domain, DomainParticipantQos qos, Listener* listener) {
  const HiddenVariables hidden;
  guard(qos);
  return DomainParticipantFactory::get_instance()->create_participant(static_cast<std::uint32_t>(domain), qos, listener,
                                                                      eprosima::fastdds::dds::StatusMask::none());
}

void warn_of_shared_memory(const std::string& why) {
  static std::once_flag said;  // a process that joins again has said it
  std::call_once(said, [&] {
    fmt::print(stderr,
               "warning: no shared memory, UDP instead: {}; remedy: `jostle doctor` (--clean); a larger one: mount -o "
               "remount,size=512M /dev/shm, in a container --shm-size=512m or --ipc=host\n",
               why);
  });
}

// With shared memory if there is room for it, else without.
DomainParticipant* create(int domain, const DomainParticipantQos& qos, Listener* listener) {
  std::string why_not;
  if (uses_shared_memory(qos)) {
    SharedMemoryRoom room(qos, domain);
    why_not = room.why_not();
    if (why_not.empty()) {
      room.hand_over();
      DomainParticipant* participant = create_guarded(domain, qos, listener);
      if (!participant || room.take_segments()) return participant;
      DomainParticipantFactory::get_instance()->delete_participant(participant);
      why_not = "/dev/shm: another program took what was left";
    }
    warn_of_shared_memory(why_not);
  }
  DomainParticipantQos without = qos;
  if (!why_not.empty()) use_udp_instead(without);
  return create_guarded(domain, without, listener);
}

}  // namespace

bool is_protected(const DomainParticipantQos& qos) {
  return eprosima::fastrtps::rtps::PropertyPolicyHelper::find_property(qos.properties(), "dds.sec.auth.plugin");
}

Joined join(int domain, const DomainParticipantQos& qos, const std::shared_ptr<EndpointWatch>& watch) {
  if (!is_protected(qos)) {
    const auto door = std::make_shared<Guest>(watch, false);
    return {door, door->directory(), create(domain, qos, door.get())};
  }
  for (bool is_first = true;; is_first = false) {
    const auto door = std::make_shared<Guest>(watch, true);
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
