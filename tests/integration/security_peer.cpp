// A participant for strangers_test.cpp, in a process of its own as every participant
// is: says its name on some topics and prints whatever it hears on others.
//
// usage: security_peer --domain N --name WHO [--secure FOLDER | --raw FOLDER] [--no-crl]
//          [--permissions-ca FILE] [--behind SECONDS] [--size BYTES] [--publish TOPIC…] [--subscribe TOPIC…]
//
// --secure goes the way of our programs; --raw hands a folder to Fast DDS as it is, the way
// of somebody who leaves out our checks. Lines on standard output: "refused participant",
// "refused writer TOPIC", "refused reader TOPIC", "ready", "got TOPIC WHO SIZE".

#include <signal.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/log/StdoutErrConsumer.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <string>
#include <vector>

#include "services/wire/dds/joining.hpp"
#include "services/wire/dds/security.hpp"

namespace {
time_t behind = 0;  // seconds that this process's wall clock is late
}

// What libcrypto and Fast DDS call to judge dates: an attacker's clock says what he likes.
extern "C" time_t time(time_t* result) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  const time_t told = now.tv_sec - behind;
  if (result) *result = told;
  return told;
}

namespace jostle::tests {
namespace {

using namespace eprosima::fastdds::dds;

struct Arguments {
  int domain = 0;
  std::string name, secure, raw, permissions_ca;
  bool no_crl = false;
  std::size_t size = 100;  // bytes
  std::vector<std::string> publish, subscribe;
};

// A name, then blanks up to the size wanted.
class Words final : public TopicDataType {
 public:
  explicit Words(std::size_t size) {
    setName("Words");
    m_typeSize = static_cast<std::uint32_t>(size + kHeader);
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    const auto& text = *static_cast<std::string*>(data);
    if (payload->max_size < text.size() + kHeader) return false;
    std::memcpy(payload->data, "\0\1\0\0", kHeader);  // CDR, little endian
    std::memcpy(payload->data + kHeader, text.data(), text.size());
    payload->length = static_cast<std::uint32_t>(text.size() + kHeader);
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    if (payload->length < kHeader) return false;
    static_cast<std::string*>(data)->assign(reinterpret_cast<char*>(payload->data) + kHeader,
                                            payload->length - kHeader);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<std::string*>(data)->size() + kHeader); };
  }
  void* createData() override { return new std::string(); }
  void deleteData(void* data) override { delete static_cast<std::string*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }

 private:
  static constexpr std::size_t kHeader = 4;
};

class Ear final : public DataReaderListener {
 public:
  void on_data_available(DataReader* reader) override {
    std::string text;
    SampleInfo info;
    while (reader->take_next_sample(&text, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      std::printf("got %s %s %zu\n", reader->get_topicdescription()->get_name().c_str(),
                  text.substr(0, text.find(' ')).c_str(), text.size());
    }
  }
};

// The properties by hand, unchecked.
void protect_unchecked(DomainParticipantQos& qos, const Arguments& arguments) {
  const auto add = [&](const std::string& name, const std::string& value) {
    qos.properties().properties().emplace_back(name, value);
  };
  const std::string folder = "file://" + arguments.raw + "/";
  const std::string authentication = "dds.sec.auth.builtin.PKI-DH.",
                    access = "dds.sec.access.builtin.Access-Permissions.";
  add("dds.sec.auth.plugin", "builtin.PKI-DH");
  add(authentication + "identity_ca", folder + "ca.pem");
  add(authentication + "identity_certificate", folder + "cert.pem");
  add(authentication + "private_key", folder + "key.pem");
  if (!arguments.no_crl) add(authentication + "identity_crl", folder + "crl.pem");
  add("dds.sec.access.plugin", "builtin.Access-Permissions");
  add(access + "permissions_ca",
      arguments.permissions_ca.empty() ? folder + "ca.pem" : "file://" + arguments.permissions_ca);
  add(access + "governance", folder + "governance.p7s");
  add(access + "permissions", folder + "permissions.p7s");
  add("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
}

// As services/wire/dds sets participants up, so that peers find each other as fast.
DomainParticipantQos make_qos() {
  DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration = {2, 0};
  discovery.leaseDuration_announcementperiod = {0, 500'000'000};
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>());
  return qos;
}

int run(const Arguments& arguments) {
  // Fast DDS's own words go to standard error: standard output is the test's.
  Log::ClearConsumers();
  Log::RegisterConsumer(std::make_unique<StdoutErrConsumer>());
  DomainParticipantQos qos = make_qos();
  if (!arguments.secure.empty()) {
    if (auto ok = wire::secure(qos, arguments.secure); !ok) {
      std::fprintf(stderr, "%s\n", ok.error().message.c_str());
      return 2;
    }
  }
  if (!arguments.raw.empty()) protect_unchecked(qos, arguments);
  const wire::Joined joined = wire::join(arguments.domain, qos, {});
  DomainParticipant* participant = joined.participant;
  if (!participant) {
    std::printf("refused participant\n");
    return 1;
  }
  TypeSupport type(new Words(arguments.size));
  type.register_type(participant);
  const auto topic = [&](const std::string& name) {
    auto* known = dynamic_cast<Topic*>(participant->lookup_topicdescription(name));
    return known ? known : participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
  };
  Subscriber* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  Publisher* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  static Ear ear;
  DataReaderQos reader_qos = DATAREADER_QOS_DEFAULT;
  reader_qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  for (const std::string& name : arguments.subscribe) {
    if (!subscriber->create_datareader(topic(name), reader_qos, &ear)) std::printf("refused reader %s\n", name.c_str());
  }
  std::vector<DataWriter*> writers;
  for (const std::string& name : arguments.publish) {
    DataWriter* writer = publisher->create_datawriter(topic(name), DATAWRITER_QOS_DEFAULT);
    writer ? writers.push_back(writer) : void(std::printf("refused writer %s\n", name.c_str()));
  }
  std::printf("ready\n");
  std::string words = arguments.name + " ";
  words.resize(std::max(words.size(), arguments.size), ' ');
  constexpr timespec kPeriod{0, 20'000'000};  // 50 samples per second and topic
  for (;;) {
    for (DataWriter* writer : writers) writer->write(&words);
    nanosleep(&kPeriod, nullptr);
  }
}

}  // namespace
}  // namespace jostle::tests

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // the test reads along
  jostle::tests::Arguments arguments;
  long late = 0;
  CLI::App app{"A participant for tests of DDS Security."};
  app.add_option("--domain", arguments.domain)->required();
  app.add_option("--name", arguments.name)->required();
  app.add_option("--secure", arguments.secure);
  app.add_option("--raw", arguments.raw);
  app.add_option("--permissions-ca", arguments.permissions_ca);
  app.add_flag("--no-crl", arguments.no_crl);
  app.add_option("--behind", late);
  app.add_option("--size", arguments.size);
  app.add_option("--publish", arguments.publish);
  app.add_option("--subscribe", arguments.subscribe);
  CLI11_PARSE(app, argc, argv);
  behind = late;
  return jostle::tests::run(arguments);
}
