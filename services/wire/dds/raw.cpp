#include "services/wire/dds/raw.hpp"

#include <algorithm>
#include <cstring>
#include <vector>

#include "services/wire/dds/raw_type.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::wire {
namespace {

using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

// The generated code of a keyed type of ours; empty for every other type.
TypeSupport keyed_type(const std::string& type) {
  TypeSupport found;
  const auto look_at = [&]<class T>(const Topic<T>&) {
    auto* serializer = new Serializer<T>();
    const TypeSupport support(serializer);
    if (serializer->m_isGetKeyDefined && type == serializer->getName()) found = support;
  };
  std::apply([&](const auto&... topic) { (look_at(topic), ...); }, topics::all());
  return found;
}

class RawType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit RawType(const std::string& name) : keyed_(keyed_type(name)) {
    setName(name.c_str());
    m_typeSize = 256;  // of the first payloads; larger samples get larger ones
    m_isGetKeyDefined = !keyed_.empty();
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto bytes = static_cast<const RawSample*>(data)->bytes;
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = static_cast<std::uint16_t>(bytes[1]);
    return true;
  }

  bool deserialize(SerializedPayload_t* payload, void* data) override {
    auto& sample = *static_cast<RawSample*>(data);
    if (payload->length < kEncapsulation) return false;
    try {
      const auto* begin = reinterpret_cast<const std::byte*>(payload->data);
      sample.own.assign(begin, begin + payload->length);
    } catch (...) {  // no memory; the middleware's threads must not see it
      return false;
    }
    sample.bytes = sample.own;
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<const RawSample*>(data)->bytes.size()); };
  }

  void* createData() override { return new RawSample(); }
  void deleteData(void* data) override { delete static_cast<RawSample*>(data); }

  bool getKey(void* data, InstanceHandle_t* handle, bool force_md5) override {
    if (keyed_.empty()) return false;
    const auto bytes = static_cast<const RawSample*>(data)->bytes;
    SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
    std::memcpy(payload.data, bytes.data(), bytes.size());
    payload.length = static_cast<std::uint32_t>(bytes.size());
    TypeSupport type = keyed_;
    void* sample = type.create_data();
    // A sample that cannot be read has a key, too, that of an empty one: Fast DDS 2.9.1 ends the process of a reader
    // by an assertion that got a sample without one.
    if (!type.deserialize(&payload, sample)) {
      type.delete_data(sample);
      sample = type.create_data();
    }
    const bool ok = type.get_key(sample, handle, force_md5);
    type.delete_data(sample);
    return ok;
  }

 private:
  const TypeSupport keyed_;
};

}  // namespace

TypeSupport raw_type(const std::string& name) { return TypeSupport(new RawType(name)); }

bool can_be_raw(const std::string& type, bool keyed) { return !keyed_type(type).empty() == keyed; }

RawWriter::RawWriter(const Participant& participant, const RawTopic& topic)
    : WriterBase(participant, topic.name, topic.qos, raw_type(topic.type)) {}

bool RawWriter::write(std::span<const std::byte> sample) {
  if (sample.size() < kEncapsulation) return false;
  const RawSample raw{.bytes = sample};
  return write_sample(&raw);
}

RawReader::RawReader(const Participant& participant, const RawTopic& topic, OnSample on_sample)
    : ReaderBase(participant, topic.name, topic.qos, raw_type(topic.type),
                 [on_sample = std::move(on_sample)](void* sample, const Origin& origin) {
                   on_sample(static_cast<const RawSample*>(sample)->bytes, origin);
                 }) {}

}  // namespace jostle::wire
