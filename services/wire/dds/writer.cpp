#include "services/wire/dds/writer.hpp"

#include <algorithm>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>

#include "services/wire/dds/core.hpp"
#include "services/wire/dds/profiles.hpp"

namespace jostle::wire {

using namespace eprosima::fastdds::dds;

void apply_to_writer(const Qos& qos, DataWriterQos& writer) {
  apply(qos, writer);
  if (qos.retained) writer.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
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
    readers.update(iHandle2GUID(status.last_subscription_handle), status.current_count_change);
  }

  Participant participant;
  eprosima::fastdds::dds::Topic* topic = nullptr;
  DataWriter* writer = nullptr;
  Peers readers;
};

WriterBase::WriterBase(const Participant& participant, const std::string& topic, const Qos& qos, TypeSupport type)
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

int WriterBase::matched() const { return impl_->readers.count(); }

bool WriterBase::wait_for_readers(TimePoint deadline, int count) const {
  return impl_->readers.wait_for(count, deadline);
}

std::vector<std::uint64_t> WriterBase::matched_participants() const { return impl_->readers.participants(); }

bool WriterBase::reaches(std::uint64_t participant) const { return impl_->readers.include(participant); }

bool WriterBase::wait_until_received(TimePoint deadline) const {
  const std::chrono::duration<double> time = deadline - std::chrono::steady_clock::now();
  if (time.count() <= 0) return false;
  return impl_->writer->wait_for_acknowledgments({static_cast<double>(time.count())}) == ReturnCode_t::RETCODE_OK;
}

void WriterBase::forget() {
  std::size_t dropped = 0;
  impl_->writer->clear_history(&dropped);
}

bool WriterBase::write_sample(const void* data) {
  // The middleware only reads it; its signature predates const.
  return impl_->writer->write(const_cast<void*>(data));
}

}  // namespace jostle::wire
