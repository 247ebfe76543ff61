#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "services/bags/format/folder_reader.hpp"
#include "services/bags/tool/commands.hpp"
#include "services/bags/tool/decoders.hpp"
#include "services/common/process/program.hpp"
#include "services/common/terminal/progress_line.hpp"

namespace jostle::bags {
namespace {

// Reads every message: as many as the bag says, in order, decodable.
Result<std::uint64_t> read_all(BagReader& reader, const Decoders& decoders, Findings& findings, std::stop_token stop) {
  const BagInfo& info = reader.info();
  std::vector<std::uint64_t> counts(info.topics.size(), 0);
  std::uint64_t done = 0;
  Time before = std::numeric_limits<Time>::min();
  common::ProgressLine progress({.doing = "verifying", .unit = "messages", .wiped = true});
  while (true) {
    if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    progress.show(done, info.messages);
    auto message_result = reader.next();
    if (!message_result) return message_result.error();
    if (!*message_result) break;
    const Message& message = **message_result;
    if (message.log_time < before) {
      return Error{Code::kInvalidArgument, fmt::format("{}: got log time {} after {}, wanted them in order",
                                                       info.path.string(), message.log_time, before)};
    }
    before = message.log_time;
    ++counts[static_cast<std::size_t>(message.topic)];
    ++done;
    if (!decoders.has(message.topic)) continue;
    if (auto decoded = decoders.decode(message); !decoded) {
      const std::string& name = info.topics[static_cast<std::size_t>(message.topic)].topic.name;
      findings.flawed(Part::kMessage, name + " cannot be decoded", decoded.error().message);
    }
  }
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == info.topics[i].messages) continue;
    findings.flawed(Part::kTopic,
                    fmt::format("{}: got {} messages, wanted {} as the bag says", info.topics[i].topic.name, counts[i],
                                info.topics[i].messages),
                    info.path.string());
  }
  return done;
}

// What is there and of no consequence: records of kinds that readers pass over, as the format wants them to.
bool is_harmless(const Finding& finding) { return finding.part == Part::kUnknownRecord; }

}  // namespace

int verify_bag(const std::filesystem::path& bag, std::stop_token stop) {
  const auto reader_result = open_bag(bag, false, stop);
  if (!reader_result) return fail(reader_result.error(), common::kExitFailed);
  CheckedReader& reader = **reader_result;
  const BagInfo& info = reader.info();
  const Decoders decoders(info);
  const auto verified_result = reader.verify([&](const auto&) { return !stop.stop_requested(); });
  if (!verified_result) return fail(verified_result.error(), common::kExitFailed);
  Findings findings;
  findings.add_all(*verified_result);
  const auto count_result = read_all(reader, decoders, findings, stop);
  if (!count_result) return fail(count_result.error(), common::kExitFailed);
  for (int topic = 0; topic < static_cast<int>(info.topics.size()); ++topic) {
    if (!decoders.has(topic)) fmt::print("not decoded: {}\n", decoders.reason(topic));
  }
  const bool is_right = std::ranges::all_of(findings.list(), is_harmless);
  for (const Finding& finding : findings.list()) {
    if (is_harmless(finding)) {
      fmt::print("not looked into: {}\n", finding.text());
    } else {
      tell(finding.text());
    }
  }
  const std::uint64_t lost = findings.count_lost(Part::kMessage);
  fmt::print("{}: {} messages of {} topics in {} file{}{}\n", is_right ? "ok" : "not ok", *count_result,
             info.topics.size(), info.files.size(), info.files.size() == 1 ? "" : "s",
             lost == 0 ? "" : fmt::format(" were taken, of {} that were met", *count_result + lost));
  return is_right ? common::kExitOk : common::kExitFailed;
}

}  // namespace jostle::bags
