#include "services/dds/reader.hpp"

#include <fmt/format.h>

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "services/dds/core.hpp"

namespace jostle::dds {
namespace {

using namespace eprosima::fastdds::dds;

DataReaderQos reader_qos(const Participant::Core& core, const Qos& qos) {
  DataReaderQos result = core.subscriber->get_default_datareader_qos();
  apply(qos, result);
  return result;
}

}  // namespace

struct ReaderBase::Impl : DataReaderListener {
  Impl(Participant owner, void* buffer, std::function<void()> callback)
      : participant(std::move(owner)), scratch(buffer), on_sample(std::move(callback)) {}

  void on_data_available(DataReader* source) override {
    const std::lock_guard lock(mutex);
    if (closed) return;
    SampleInfo info;
    while (source->take_next_sample(scratch, &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) call();
    }
  }

  void call() {
    try {
      on_sample();
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}: a sample was dropped: {}\n", topic->get_name(), error.what());
    }
  }

  Participant participant;
  void* scratch;
  std::function<void()> on_sample;
  eprosima::fastdds::dds::Topic* topic = nullptr;
  DataReader* reader = nullptr;

  std::mutex mutex;  // guards closed, and scratch while a callback runs
  bool closed = false;
};

ReaderBase::ReaderBase(const Participant& participant, const std::string& topic, const Qos& qos,
                       TypeSupport type, void* scratch, std::function<void()> on_sample)
    : impl_(std::make_unique<Impl>(participant, scratch, std::move(on_sample))) {
  Participant::Core& core = participant.core();
  impl_->topic = core.acquire_topic(topic, type);
  impl_->reader = core.subscriber->create_datareader(impl_->topic, reader_qos(core, qos), impl_.get(),
                                                     StatusMask::data_available());
  if (impl_->reader) return;
  core.release_topic(impl_->topic);
  throw SetupError("topic " + topic + ": the middleware refused a reader");
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
