#include "services/wire/dds/service.hpp"

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <mutex>

#include "services/common/process/trouble.hpp"
#include "services/wire/dds/core.hpp"
#include "services/wire/dds/raw_type.hpp"

namespace jostle::wire {

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::SequenceNumber_t;
using eprosima::fastrtps::rtps::WriteParams;

namespace {

// ROS 2's for services: reliable, and nothing for those who come later.
constexpr Qos kService{.depth = 64};

constexpr std::uint8_t kCyclone[] = {0x01, 0x10};  // Eclipse Cyclone DDS among RTPS's vendors

GUID_t from_guid(const Guid& guid) {
  GUID_t result;
  std::copy_n(guid.begin(), sizeof result.guidPrefix.value, result.guidPrefix.value);
  std::copy_n(guid.begin() + sizeof result.guidPrefix.value, sizeof result.entityId.value, result.entityId.value);
  return result;
}

Asker asker_of(const SampleInfo& info) {
  const GUID_t& writer = info.sample_identity.writer_guid();
  const GUID_t& named = info.related_sample_identity.writer_guid();
  // A client that is older names nothing, and knows itself by its writer.
  return {.reader = to_guid(named == GUID_t::unknown() ? writer : named),
          .number = static_cast<std::int64_t>(info.sample_identity.sequence_number().to64long()),
          .is_in_data = std::equal(std::begin(kCyclone), std::end(kCyclone), writer.guidPrefix.value),
          .participant = participant_id(writer)};
}

}  // namespace

struct ServiceBase::Impl : DataReaderListener, DataWriterListener {
  Impl(Participant owner, OnRequest callback) : participant(std::move(owner)), on_request(std::move(callback)) {}

  void on_data_available(DataReader* source) override {
    RawSample sample;
    SampleInfo info;
    while (source->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) call(sample.bytes, asker_of(info));
    }
  }

  void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
    askers.update(iHandle2GUID(status.last_subscription_handle), status.current_count_change);
  }

  void call(std::span<const std::byte> request, const Asker& asker) {
    const std::lock_guard lock(mutex);
    if (closed) return;
    try {
      if (request.size() > kMostRequest)
        throw std::length_error(fmt::format("got {} bytes, wanted at most {}", request.size(), kMostRequest));
      on_request(request, asker);
    } catch (const std::exception& error) {
      dropped.warn("{}: a request was dropped: {}", requests_topic->get_name(), common::shown(error.what()));
    }
  }

  bool wait_until_reaches(std::uint64_t asker) const {
    const auto deadline = std::chrono::steady_clock::now() + kAskerPatience;
    while (!askers.include(asker)) {
      if (!askers.wait_for(askers.count() + 1, deadline)) return askers.include(asker);
    }
    return true;
  }

  Participant participant;
  const OnRequest on_request;
  eprosima::fastdds::dds::Topic* requests_topic = nullptr;
  eprosima::fastdds::dds::Topic* responses_topic = nullptr;
  DataReader* requests = nullptr;
  DataWriter* responses = nullptr;
  Peers askers;
  common::Trouble dropped{"requests were dropped"};

  std::mutex mutex;  // guards closed; held during a callback, so one runs at a time
  bool closed = false;
};

ServiceBase::ServiceBase(const Participant& participant, const std::string& name, const std::string& request_type,
                         const std::string& response_type, OnRequest on_request)
    : impl_(std::make_unique<Impl>(participant, std::move(on_request))) {
  Participant::Core& core = participant.core();
  impl_->requests_topic =
      core.acquire_topic(participant.wire_name("rq" + name + "Request", Scope::kRobot), raw_type(request_type));
  impl_->responses_topic =
      core.acquire_topic(participant.wire_name("rr" + name + "Reply", Scope::kRobot), raw_type(response_type));
  DataWriterQos writer_qos = core.publisher->get_default_datawriter_qos();
  apply_to_writer(kService, writer_qos);
  DataReaderQos reader_qos = core.subscriber->get_default_datareader_qos();
  apply_to_reader(kService, reader_qos);
  impl_->responses = core.publisher->create_datawriter(impl_->responses_topic, writer_qos, impl_.get(),
                                                       StatusMask::publication_matched());
  if (impl_->responses) {
    impl_->requests = core.subscriber->create_datareader(impl_->requests_topic, reader_qos, impl_.get(),
                                                         StatusMask::data_available());
  }
  if (impl_->requests) return;
  if (impl_->responses) core.publisher->delete_datawriter(impl_->responses);
  core.release_topic(impl_->responses_topic);
  core.release_topic(impl_->requests_topic);
  throw SetupError("service " + name + ": the middleware refused it");
}

ServiceBase::~ServiceBase() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->closed = true;
  }
  impl_->requests->set_listener(nullptr);
  impl_->responses->set_listener(nullptr);
  Participant::Core& core = impl_->participant.core();
  core.subscriber->delete_datareader(impl_->requests);
  core.publisher->delete_datawriter(impl_->responses);
  core.release_topic(impl_->responses_topic);
  core.release_topic(impl_->requests_topic);
}

bool ServiceBase::send(const Asker& asker, std::span<const std::byte> response) {
  if (!impl_->wait_until_reaches(asker.participant)) return false;
  RawSample sample{.bytes = response, .own = {}};
  WriteParams params;
  if (!asker.is_in_data) {
    params.related_sample_identity().writer_guid() = from_guid(asker.reader);
    params.related_sample_identity().sequence_number() = SequenceNumber_t(static_cast<std::uint64_t>(asker.number));
  }
  return impl_->responses->write(&sample, params);
}

}  // namespace jostle::wire
