#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/tool/commands.hpp"
#include "services/common/process/program.hpp"

namespace jostle::bags {
namespace {

// A copy of metadata.yaml in rosbag2's files.
constexpr const char* kRosbag2 = "rosbag2";

double seconds(Time time) { return 1e-9 * static_cast<double>(time); }

std::string date_text(Time time) {
  constexpr Time kSecond = 1'000'000'000;
  return fmt::format("{:%Y-%m-%d %H:%M:%S}.{:06} UTC", fmt::gmtime(static_cast<std::time_t>(time / kSecond)),
                     time % kSecond / 1000);
}

std::string size_text(std::uint64_t bytes) {
  if (bytes < 10'000) return fmt::format("{} bytes", bytes);
  if (bytes < 10'000'000) return fmt::format("{:.1f} kB", 1e-3 * static_cast<double>(bytes));
  return fmt::format("{:.1f} MB", 1e-6 * static_cast<double>(bytes));
}

// As the recorder has counted it; nothing if it has not.
std::string lost_of(const BagInfo& info, const std::string& topic) {
  const auto note = info.notes.find(kLostNote);
  if (note == info.notes.end()) return "";
  const auto count = note->second.find(topic);
  return count == note->second.end() ? "0" : count->second;
}

double rate_of(const BagInfo& info, const TopicInfo& topic) {
  return info.end > info.start ? static_cast<double>(topic.messages) / seconds(info.end - info.start) : 0.0;
}

std::string qos_words(const Qos& qos) {
  return fmt::format("{}{}{}", qos.reliable ? "reliable" : "best effort", qos.latched ? ", latched" : "",
                     qos.retained ? ", retained" : "");
}

nlohmann::ordered_json to_json(const BagInfo& info, const std::vector<Finding>& findings) {
  nlohmann::ordered_json topics = nlohmann::ordered_json::array();
  for (const TopicInfo& topic : info.topics) {
    nlohmann::ordered_json object{{"name", topic.topic.name},
                                  {"type", topic.topic.type},
                                  {"messages", topic.messages},
                                  {"rate", rate_of(info, topic)},
                                  {"lost", nullptr},
                                  {"qos",
                                   {{"reliable", topic.topic.qos.reliable},
                                    {"latched", topic.topic.qos.latched},
                                    {"retained", topic.topic.qos.retained},
                                    {"depth", topic.topic.qos.depth}}},
                                  {"encoding", topic.topic.encoding},
                                  {"has_definition", topic.topic.has_message_definition()}};
    if (const std::string lost = lost_of(info, topic.topic.name); !lost.empty()) {
      object["lost"] = std::atoll(lost.c_str());
    }
    topics.push_back(std::move(object));
  }
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const auto& file : info.files) files.push_back(file.string());
  nlohmann::ordered_json attachments = nlohmann::ordered_json::array();
  for (const AttachmentInfo& attachment : info.attachments) {
    attachments.push_back(
        {{"name", attachment.name}, {"media_type", attachment.media_type}, {"bytes", attachment.bytes}});
  }
  nlohmann::ordered_json found = nlohmann::ordered_json::array();
  for (const Finding& finding : findings) {
    found.push_back({{"part", name_of(finding.part, 1)},
                     {"count", finding.count},
                     {"lost", finding.is_lost},
                     {"what", finding.what}});
  }
  return {{"path", info.path.string()},
          {"storage", info.storage},
          {"files", files},
          {"bytes", info.bytes},
          {"start_ns", info.start},
          {"end_ns", info.end},
          {"duration_s", seconds(info.end - info.start)},
          {"messages", info.messages},
          {"topics", topics},
          {"notes", info.notes},
          {"earlier_notes", info.earlier_notes},
          {"attachments", attachments},
          {"findings", found}};
}

// "33", or "31 in cdr, 2 in json".
std::string messages_text(const BagInfo& info) {
  std::map<std::string, std::uint64_t> counts;
  for (const TopicInfo& topic : info.topics) counts[topic.topic.encoding] += topic.messages;
  if (counts.size() <= 1 && (counts.empty() || counts.contains("cdr"))) return std::to_string(info.messages);
  std::string text;
  for (const auto& [encoding, count] : counts) {
    text += fmt::format("{}{} in {}", text.empty() ? "" : ", ", count, encoding.empty() ? "none" : encoding);
  }
  return text;
}

void print_note(const std::string& name, const Note& note) {
  fmt::print("\n{}\n", name);
  for (const auto& [key, value] : note) fmt::print("  {}: {}\n", key, value);
}

void print(const BagInfo& info) {
  fmt::print("bag       {}\nstorage   {}, {} in {} file{}\n", info.path.string(), info.storage, size_text(info.bytes),
             info.files.size(), info.files.size() == 1 ? "" : "s");
  if (info.messages > 0) {
    fmt::print("start     {}\nend       {}\nduration  {:.3f} s\n", date_text(info.start), date_text(info.end),
               seconds(info.end - info.start));
  }
  fmt::print("messages  {}\n", messages_text(info));
  std::size_t name_width = 5, type_width = 4;
  for (const TopicInfo& topic : info.topics) {
    name_width = std::max(name_width, topic.topic.name.size());
    type_width = std::max(type_width, topic.topic.type.size());
  }
  fmt::print("\n{:{}}  {:{}}  {:>9}  {:>9}  {:>6}  {}\n", "topic", name_width, "type", type_width, "messages", "1/s",
             "lost", "offered");
  for (const TopicInfo& topic : info.topics) {
    const std::string lost = lost_of(info, topic.topic.name);
    fmt::print("{:{}}  {:{}}  {:>9}  {:>9.1f}  {:>6}  {}\n", topic.topic.name, name_width, topic.topic.type, type_width,
               topic.messages, rate_of(info, topic), lost.empty() ? "-" : lost, qos_words(topic.topic.qos));
  }
  for (const auto& [name, note] : info.notes) {
    if (name == kRosbag2 || name == kLostNote) continue;
    print_note(name, note);
  }
  for (const auto& [name, note] : info.earlier_notes) print_note(name, note);
  for (const AttachmentInfo& attachment : info.attachments) {
    fmt::print("\nattachment {}: {}, {}\n", attachment.name, attachment.media_type, size_text(attachment.bytes));
  }
}

}  // namespace

int show_info(const InfoArguments& arguments) {
  const auto reader_result = BagReader::open(arguments.bag);
  if (!reader_result) return fail(reader_result.error(), common::kExitUsage);
  const BagInfo& info = (*reader_result)->info();
  if (arguments.as_json) {
    fmt::print(
        "{}\n",
        to_json(info, (*reader_result)->findings()).dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  } else {
    print(info);
    for (const Finding& finding : (*reader_result)->findings()) tell(finding.text());
  }
  return common::kExitOk;
}

}  // namespace jostle::bags
