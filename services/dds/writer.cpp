#include "services/dds/writer.hpp"

#include <algorithm>
#include <condition_variable>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>

#include "services/dds/core.hpp"
#include "services/dds/profiles.hpp"

namespace jostle::dds {

using namespace eprosima::fastdds::dds;

void apply_to_writer(const Qos& qos, DataWriterQos& writer) {
  apply(qos, writer);
  writer.publish_mode().kind = SYNCHRONOUS_PUBLISH_MODE;
  // A lost last packet is noticed by the next heartbeat; the default is 3 s.
  writer.reliable_writer_qos().times.heartbeatPeriod = {0, 100'000'000};
}

namespace {

DataWriterQos writer_qos(const Participant::Core& core, const std::string& topic, const Qos& qos) {
  DataWriterQos result = core.publisher->get_default_datawriter_qos();
  apply_to_writer(qos, result);
  // The file's word is in force instead, where it has one.
  for (const std::string& profile : profiles_for(core, topic, qos)) {
    if (core.publisher->get_datawriter_qos_from_profile(profile, result) == ReturnCode_t::RETCODE_OK) break;
  }
  return result;
}

}  // namespace

struct WriterBase::Impl : DataWriterListener {
  explicit Impl(Participant owner) : participant(std::move(owner)) {}

  void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
    const std::lock_guard lock(mutex);
    const auto reader = iHandle2GUID(status.last_subscription_handle);
    if (status.current_count_change > 0) {
      readers.push_back(reader);
    } else {
      std::erase(readers, reader);
    }
    changed.notify_all();
  }

  Participant participant;
  eprosima::fastdds::dds::Topic* topic = nullptr;
  DataWriter* writer = nullptr;

  mutable std::mutex mutex;  // guards readers
  std::condition_variable changed;
  std::vector<eprosima::fastrtps::rtps::GUID_t> readers;
};

WriterBase::WriterBase(const Participant& participant, const std::string& topic, const Qos& qos,
                       TypeSupport type)
    : impl_(std::make_unique<Impl>(participant)) {
  Participant::Core& core = participant.core();
  impl_->topic = core.acquire_topic(topic, type);
  impl_->writer = core.publisher->create_datawriter(impl_->topic, writer_qos(core, topic, qos), impl_.get(),
                                                    StatusMask::publication_matched());
  if (impl_->writer) return;
  core.release_topic(impl_->topic);
  throw SetupError("topic " + topic + ": the middleware refused a writer; profiles: " + profiles_file().path.string());
}

WriterBase::~WriterBase() {
  if (!impl_) return;
  impl_->writer->set_listener(nullptr);
  Participant::Core& core = impl_->participant.core();
  core.publisher->delete_datawriter(impl_->writer);
  core.release_topic(impl_->topic);
}

WriterBase::WriterBase(WriterBase&&) noexcept = default;
WriterBase& WriterBase::operator=(WriterBase&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

int WriterBase::matched() const {
  const std::lock_guard lock(impl_->mutex);
  return static_cast<int>(impl_->readers.size());
}

bool WriterBase::wait_for_readers(TimePoint deadline, int count) const {
  std::unique_lock lock(impl_->mutex);
  return impl_->changed.wait_until(lock, deadline, [&] {
    return static_cast<int>(impl_->readers.size()) >= count;
  });
}

std::vector<std::uint64_t> WriterBase::matched_participants() const {
  std::vector<std::uint64_t> ids;
  {
    const std::lock_guard lock(impl_->mutex);
    for (const auto& reader : impl_->readers) ids.push_back(participant_id(reader));
  }
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

bool WriterBase::write_sample(const void* data) {
  // The middleware only reads it; its signature predates const.
  return impl_->writer->write(const_cast<void*>(data));
}

}  // namespace jostle::dds
