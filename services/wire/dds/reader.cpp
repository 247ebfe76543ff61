#include "services/wire/dds/reader.hpp"

#include <algorithm>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "services/common/process/trouble.hpp"
#include "services/wire/dds/core.hpp"
#include "services/wire/dds/profiles.hpp"

namespace jostle::wire {

using namespace eprosima::fastdds::dds;

void apply_to_reader(const Qos& qos, DataReaderQos& reader) {
  apply(qos, reader);
  reader.resource_limits().max_instances = std::max(qos.instances, qos.instances_heard);
}

namespace {

DataReaderQos reader_qos(const Participant::Core& core, const std::string& topic, const Qos& qos) {
  DataReaderQos result = core.subscriber->get_default_datareader_qos();
  apply_to_reader(qos, result);
  // The file's word is in force instead, where it has one.
  for (const std::string& profile : profiles_for(core, topic, qos)) {
    if (core.subscriber->get_datareader_qos_from_profile(profile, result) == ReturnCode_t::RETCODE_OK) break;
  }
  return result;
}

Origin origin_of(const SampleInfo& info) {
  const auto& identity = info.sample_identity;
  return {.participant = participant_id(identity.writer_guid()),
          .writer = to_guid(identity.writer_guid()),
          .sequence = identity.sequence_number().to64long(),
          .source_time = info.source_timestamp.to_ns()};
}

}  // namespace

struct ReaderBase::Impl : DataReaderListener {
  Impl(Participant owner, TypeSupport type_support, std::function<void(void*, const Origin&)> callback)
      : participant(std::move(owner)), type(std::move(type_support)), on_sample(std::move(callback)) {}

  void on_data_available(DataReader* source) override {
    const auto destroy = [this](void* sample) { type.delete_data(sample); };
    const std::unique_ptr<void, decltype(destroy)> sample(type.create_data(), destroy);
    SampleInfo info;
    // The mutex is not held while taking: the middleware has locks of its own.
    while (source->take_next_sample(sample.get(), &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) call(sample.get(), origin_of(info));
    }
  }

  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    writers.update(iHandle2GUID(status.last_publication_handle), status.current_count_change);
  }

  void call(void* sample, const Origin& origin) {
    const std::lock_guard lock(mutex);
    if (closed) return;
    try {
      on_sample(sample, origin);
    } catch (const std::exception& error) {
      dropped.warn("{}: a sample was dropped: {}", topic->get_name(), common::shown(error.what()));
    }
  }

  Participant participant;
  TypeSupport type;
  std::function<void(void*, const Origin&)> on_sample;
  eprosima::fastdds::dds::Topic* topic = nullptr;
  DataReader* reader = nullptr;
  Peers writers;
  common::Trouble dropped{"samples were dropped"};

  std::mutex mutex;  // guards closed; held during a callback, so one runs at a time
  bool closed = false;
};

ReaderBase::ReaderBase(const Participant& participant, const std::string& topic, const Qos& qos, TypeSupport type,
                       std::function<void(void*, const Origin&)> on_sample)
    : impl_(std::make_unique<Impl>(participant, type, std::move(on_sample))) {
  Participant::Core& core = participant.core();
  impl_->topic = core.acquire_topic(topic, type);
  impl_->reader =
      core.subscriber->create_datareader(impl_->topic, reader_qos(core, topic, qos), impl_.get(),
                                         StatusMask::data_available() << StatusMask::subscription_matched());
  if (impl_->reader) return;
  core.release_topic(impl_->topic);
  throw SetupError("topic " + topic + ": the middleware refused a reader; profiles: " + profiles_file().path.string());
}

ReaderBase::~ReaderBase() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->closed = true;
  }
  impl_->reader->set_listener(nullptr);
  Participant::Core& core = impl_->participant.core();
  core.subscriber->delete_datareader(impl_->reader);
  core.release_topic(impl_->topic);
}

int ReaderBase::matched() const { return impl_->writers.count(); }

ReaderTroubles ReaderBase::troubles() const {
  SampleLostStatus lost;
  SampleRejectedStatus rejected;
  RequestedIncompatibleQosStatus incompatible;
  impl_->reader->get_sample_lost_status(lost);
  impl_->reader->get_sample_rejected_status(rejected);
  impl_->reader->get_requested_incompatible_qos_status(incompatible);
  return {.lost = static_cast<std::uint64_t>(lost.total_count),
          .rejected = static_cast<std::uint64_t>(rejected.total_count),
          .incompatible = static_cast<std::uint64_t>(incompatible.total_count)};
}

std::vector<std::uint64_t> ReaderBase::matched_participants() const { return impl_->writers.participants(); }

bool ReaderBase::hears(std::uint64_t participant) const { return impl_->writers.include(participant); }

}  // namespace jostle::wire
