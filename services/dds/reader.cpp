#include "services/dds/reader.hpp"

#include <fmt/format.h>

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "services/dds/core.hpp"
#include "services/dds/profiles.hpp"

namespace jostle::dds {
namespace {

using namespace eprosima::fastdds::dds;

DataReaderQos reader_qos(const Participant::Core& core, const std::string& topic, const Qos& qos) {
  DataReaderQos result = core.subscriber->get_default_datareader_qos();
  apply(qos, result);
  // The file's word is in force instead, where it has one.
  for (const std::string& profile : profiles_for(core, topic, qos)) {
    if (core.subscriber->get_datareader_qos_from_profile(profile, result) == ReturnCode_t::RETCODE_OK) break;
  }
  return result;
}

}  // namespace

struct ReaderBase::Impl : DataReaderListener {
  Impl(Participant owner, TypeSupport type_support, std::function<void(const void*)> callback)
      : participant(std::move(owner)), type(std::move(type_support)), on_sample(std::move(callback)) {}

  void on_data_available(DataReader* source) override {
    const auto destroy = [this](void* sample) { type.delete_data(sample); };
    const std::unique_ptr<void, decltype(destroy)> sample(type.create_data(), destroy);
    SampleInfo info;
    // The mutex is not held while taking: the middleware has locks of its own.
    while (source->take_next_sample(sample.get(), &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) call(sample.get());
    }
  }

  void call(const void* sample) {
    const std::lock_guard lock(mutex);
    if (closed) return;
    try {
      on_sample(sample);
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}: a sample was dropped: {}\n", topic->get_name(), error.what());
    }
  }

  Participant participant;
  TypeSupport type;
  std::function<void(const void*)> on_sample;
  eprosima::fastdds::dds::Topic* topic = nullptr;
  DataReader* reader = nullptr;

  std::mutex mutex;  // guards closed; held during a callback, so one runs at a time
  bool closed = false;
};

ReaderBase::ReaderBase(const Participant& participant, const std::string& topic, const Qos& qos,
                       TypeSupport type, std::function<void(const void*)> on_sample)
    : impl_(std::make_unique<Impl>(participant, type, std::move(on_sample))) {
  Participant::Core& core = participant.core();
  impl_->topic = core.acquire_topic(topic, type);
  impl_->reader = core.subscriber->create_datareader(impl_->topic, reader_qos(core, topic, qos), impl_.get(),
                                                     StatusMask::data_available());
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

int ReaderBase::matched() const {
  SubscriptionMatchedStatus status;
  impl_->reader->get_subscription_matched_status(status);
  return status.current_count;
}

}  // namespace jostle::dds
