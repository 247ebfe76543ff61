#include "services/wire/dds/profiles.hpp"

#include <fastrtps/attributes/PublisherAttributes.h>
#include <fastrtps/attributes/SubscriberAttributes.h>
#include <fastrtps/xmlparser/XMLParser.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <fastrtps/xmlparser/XMLTree.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tinyxml2.h>

#include <algorithm>
#include <cstdlib>
#include <fastdds/dds/log/Log.hpp>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "idl/files/files.hpp"
#include "idl/types/qos.hpp"
#include "services/common/process/files.hpp"

namespace jostle::wire {
namespace {

using eprosima::fastdds::dds::Log;
using eprosima::fastdds::dds::LogConsumer;
using eprosima::fastrtps::PublisherAttributes;
using eprosima::fastrtps::SubscriberAttributes;
using eprosima::fastrtps::xmlparser::up_base_node_t;
using eprosima::fastrtps::xmlparser::XMLP_ret;
using eprosima::fastrtps::xmlparser::XMLParser;
using eprosima::fastrtps::xmlparser::XMLProfileManager;
using tinyxml2::XMLDocument;
using tinyxml2::XMLElement;

// What Fast DDS says of a file, instead of on the terminal.
class Complaints {
 public:
  Complaints() {
    Log::ClearConsumers();
    Log::RegisterConsumer(std::make_unique<Consumer>(*this));
  }
  ~Complaints() {
    Log::Flush();
    Log::Reset();
  }

  // The first since the last call; the later ones repeat it for what is around.
  std::string first() {
    Log::Flush();
    const std::lock_guard lock(mutex_);
    const auto texts = std::exchange(texts_, {});
    return texts.empty() ? "" : texts.front();
  }

 private:
  struct Consumer final : LogConsumer {
    explicit Consumer(Complaints& owner) : complaints(owner) {}
    void Consume(const Log::Entry& entry) override {
      const std::lock_guard lock(complaints.mutex_);
      complaints.texts_.push_back(entry.message);
    }
    Complaints& complaints;
  };

  std::mutex mutex_;  // guards texts_: the middleware logs on a thread of its own
  std::vector<std::string> texts_;
};

std::string text_of(const XMLElement& element) { return element.GetText() ? element.GetText() : ""; }
std::string name_of(const XMLElement& profile) {
  const char* name = profile.Attribute("profile_name");
  return name ? name : "";
}

constexpr const char* kNumber = "a whole number";
constexpr std::size_t kMostBytes = std::size_t{256} << 10;  // thirty times what comes along
constexpr int kMostAttempts = 500;                          // at finding what a file is refused for

std::string got_in(const XMLElement& place) {
  return place.NoChildren() ? "nothing" : fmt::format("'{}'", text_of(place));
}

Error wrong(const std::filesystem::path& file, const XMLElement& place, const std::string& got,
            const std::string& wanted) {
  return {Code::kInvalidArgument,
          fmt::format("{}:{}: <{}>: got {}, wanted {}", file.string(), place.GetLineNum(), place.Name(), got, wanted)};
}

// --- what Fast DDS does not take ----------------------------------------------

// Its first complaint about a document; "" if there is none.
std::string complaint_about(XMLDocument& document, Complaints& complaints) {
  XMLProfileManager::DeleteInstance();  // parsing keeps transports, and refuses a second one of the name
  up_base_node_t parsed;
  if (XMLParser::loadXML(document, parsed) == XMLP_ret::XML_OK) return "";
  const std::string text = complaints.first();
  return text.empty() ? "it says nothing" : text;
}

// The element that the first complaint is about, the deepest such: whatever follows it may go, and
// the complaint stays; without it there is another one, or none. What follows it is lost.
XMLElement& at_fault(XMLDocument& document, const std::string& complaint, Complaints& complaints) {
  XMLElement* place = document.RootElement();
  int attempts = 0;
  for (;;) {
    XMLElement* removed = nullptr;
    XMLElement* aside = document.NewElement("aside");  // the document's, yet not in it
    do {
      removed = place->LastChildElement();
      if (!removed || ++attempts > kMostAttempts) return *place;
      aside->InsertEndChild(removed);
    } while (complaint_about(document, complaints) == complaint);
    place->InsertEndChild(removed);
    place = removed;
  }
}

std::string words_for(const XMLElement& place) {
  static const std::map<std::string, std::string> kWords{
      {"reliability", "RELIABLE or BEST_EFFORT"},
      {"durability", "VOLATILE, TRANSIENT_LOCAL, TRANSIENT or PERSISTENT"},
      {"historyQos", "KEEP_LAST or KEEP_ALL"},
      {"publishMode", "SYNCHRONOUS or ASYNCHRONOUS"},
      {"data_sharing", "AUTOMATIC, ON or OFF"},
      {"liveliness", "AUTOMATIC, MANUAL_BY_PARTICIPANT or MANUAL_BY_TOPIC"}};
  const auto* parent = place.Parent()->ToElement();
  const auto known = parent && std::string_view(place.Name()) == "kind" ? kWords.find(parent->Name()) : kWords.end();
  return known == kWords.end() ? "" : known->second;
}

Error refusal(const std::filesystem::path& file, XMLDocument& document, const std::string& why,
              Complaints& complaints) {
  const XMLElement& place = at_fault(document, why, complaints);
  std::string wanted = words_for(place);
  if (wanted.empty() && why.find("getXMLInt") != std::string::npos) wanted = kNumber;
  if (wanted.empty() && why.find("getXMLUint") != std::string::npos) wanted = kNumber;
  if (wanted.empty() && why.find("getXMLBool") != std::string::npos) wanted = "true or false";
  if (wanted.empty()) wanted = "what Fast DDS takes there: " + why;
  return wrong(file, place, got_in(place), wanted);
}

// Numbers of which it reads as much as it can, 4 of "4 MiB", or in other notations, 16 of "0x10".
Result<void> check_numbers(const std::filesystem::path& file, const XMLElement& place) {
  static const std::set<std::string> kNumbers{"allocated_samples",
                                              "depth",
                                              "domainId",
                                              "max_instances",
                                              "max_samples",
                                              "max_samples_per_instance",
                                              "maxInitialPeersRange",
                                              "maxMessageSize",
                                              "mutation_tries",
                                              "nanosec",
                                              "participantID",
                                              "port",
                                              "port_queue_capacity",
                                              "receiveBufferSize",
                                              "sec",
                                              "segment_size",
                                              "sendBufferSize",
                                              "TTL"};
  const std::string text = text_of(place);
  const bool is_word = text.starts_with("DURATION_");  // DURATION_INFINITY and its like
  if (kNumbers.contains(place.Name()) && !is_word && text.find_first_not_of("0123456789") != std::string::npos) {
    return wrong(file, place, got_in(place), kNumber);
  }
  for (const XMLElement* child = place.FirstChildElement(); child; child = child->NextSiblingElement()) {
    if (auto ok = check_numbers(file, *child); !ok) return ok;
  }
  return {};
}

// --- names --------------------------------------------------------------------

// "data_writer" or "data_reader" for both names that the format has for each; else "".
std::string side_of(const XMLElement& profile) {
  const std::string_view tag = profile.Name();
  if (tag == "data_writer" || tag == "publisher") return "data_writer";
  if (tag == "data_reader" || tag == "subscriber") return "data_reader";
  return "";
}

const XMLElement* profiles_in(const XMLDocument& document) {
  const XMLElement* root = document.RootElement();
  return root && std::string_view(root->Name()) == "dds" ? root->FirstChildElement("profiles") : root;
}

bool is_asked_for(const std::string& name) {
  return name.starts_with("rt/") || std::ranges::any_of(kKinds, [&](const Qos& kind) { return name == kind.kind; });
}

Result<void> check_names(const ProfilesFile& file, const XMLDocument& document) {
  std::set<std::pair<std::string, std::string>> seen;
  const XMLElement* profiles = profiles_in(document);
  for (const XMLElement* one = profiles ? profiles->FirstChildElement() : nullptr; one;
       one = one->NextSiblingElement()) {
    const std::string side = side_of(*one), name = name_of(*one);
    if (side.empty() && std::string_view(one->Name()) != "participant") continue;
    if (name.empty()) return wrong(file.path, *one, "no name", "profile_name=\"...\"");
    if (!seen.emplace(side, name).second)
      return wrong(file.path, *one, fmt::format("'{}' again", name), "each name once");
    if (side.empty() || file.shared || is_asked_for(name)) continue;
    std::vector<std::string> kinds;
    for (const Qos& kind : kKinds) kinds.emplace_back(kind.kind);
    return wrong(file.path, *one, fmt::format("'{}'", name),
                 fmt::format("one of: {}; or a topic such as rt/task/feedback", fmt::join(kinds, ", ")));
  }
  return {};
}

// --- promises -----------------------------------------------------------------

// The part of a profile that both sides of a topic have.
struct Promise {
  bool reliable, latched;
  int depth;
};

template <class Attributes>
Promise promise_of(const Attributes& attributes) {
  using namespace eprosima::fastdds::dds;
  return {.reliable = attributes.qos.m_reliability.kind == RELIABLE_RELIABILITY_QOS,
          .latched = attributes.qos.m_durability.kind != VOLATILE_DURABILITY_QOS,
          .depth = attributes.topic.historyQos.kind == KEEP_LAST_HISTORY_QOS ? attributes.topic.historyQos.depth : 1};
}

const XMLElement* find(const XMLDocument& document, const std::string& side, const std::string& name) {
  const XMLElement* one = profiles_in(document)->FirstChildElement();
  while (one && !(side_of(*one) == side && name_of(*one) == name)) one = one->NextSiblingElement();
  return one;
}

Result<void> check_promises(const std::filesystem::path& file, const XMLDocument& document, const Qos& kind) {
  const auto problem = [&](const char* side, const std::string& got, const std::string& wanted) {
    return wrong(file, *find(document, side, std::string(kind.kind)), fmt::format("'{}', {}", kind.kind, got), wanted);
  };
  PublisherAttributes writer;
  SubscriberAttributes reader;
  Promise asked{kind.reliable, kind.latched, kind.depth}, offered = asked;
  offered.latched = kind.latched || kind.retained;
  const std::string name(kind.kind);
  const bool offers = XMLProfileManager::fillPublisherAttributes(name, writer, false) == XMLP_ret::XML_OK;
  const bool asks = XMLProfileManager::fillSubscriberAttributes(name, reader, false) == XMLP_ret::XML_OK;
  if (offers) offered = promise_of(writer);
  if (asks) asked = promise_of(reader);
  if (offered.depth < 1) return problem("data_writer", fmt::format("depth {}", offered.depth), "at least 1");
  if (asked.depth < 1) return problem("data_reader", fmt::format("depth {}", asked.depth), "at least 1");
  const char* changed = asks ? "data_reader" : "data_writer";
  if (asked.reliable && !offered.reliable) {
    return problem(changed, "readers RELIABLE and writers BEST_EFFORT",
                   "no more from readers than writers offer: they would never meet");
  }
  if (asked.latched && !offered.latched) {
    return problem(changed, "readers TRANSIENT_LOCAL and writers VOLATILE",
                   "no more from readers than writers offer: they would never meet");
  }
  return {};
}

}  // namespace

ProfilesFile profiles_file() {
  if (const char* file = std::getenv("JOSTLE_PROFILES"); file && *file) return {.path = file};
  if (const char* file = std::getenv("FASTRTPS_DEFAULT_PROFILES_FILE"); file && *file)
    return {.path = file, .shared = true};
  const std::filesystem::path installed = common::data_file("profiles.xml");
  std::error_code ignored;
  return {.path = std::filesystem::exists(installed, ignored) ? installed : std::filesystem::path()};
}

Result<void> load_profiles(const ProfilesFile& file) {
  XMLProfileManager::DeleteInstance();
  if (file.path.empty()) return {};
  const auto text_result = files::read(file.path, kMostBytes);
  if (!text_result) return Error{text_result.error().code, text_result.error().message + "; wanted a file of profiles"};
  XMLDocument document;
  if (document.Parse(text_result->data(), text_result->size()) != tinyxml2::XML_SUCCESS) {
    return Error{Code::kInvalidArgument, fmt::format("{}:{}: got {}, wanted well-formed XML", file.path.string(),
                                                     document.ErrorLineNum(), document.ErrorName())};
  }
  if (!document.RootElement())
    return Error{Code::kInvalidArgument, fmt::format("{}: got no element, wanted <dds>", file.path.string())};
  Complaints complaints;
  if (const auto why = complaint_about(document, complaints); !why.empty())
    return refusal(file.path, document, why, complaints);
  if (auto ok = check_numbers(file.path, *document.RootElement()); !ok) return ok;
  if (auto ok = check_names(file, document); !ok) return ok;
  XMLProfileManager::DeleteInstance();
  if (XMLProfileManager::loadXMLNode(document) != XMLP_ret::XML_OK) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got a file that Fast DDS refuses, wanted profiles: {}",
                                                     file.path.string(), complaints.first())};
  }
  for (const Qos& kind : kKinds) {
    if (auto ok = check_promises(file.path, document, kind); !ok) return ok;
  }
  return {};
}

}  // namespace jostle::wire
