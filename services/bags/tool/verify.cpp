#include <fmt/format.h>

#include <limits>

#include "services/bags/format/folder_reader.hpp"
#include "services/bags/tool/commands.hpp"
#include "services/bags/tool/decoders.hpp"
#include "services/common/process/program.hpp"
#include "services/common/terminal/progress_line.hpp"

namespace jostle::bags {
namespace {

// Reads every message: as many as the bag says, in order, decodable.
Result<std::uint64_t> read_all(BagReader& reader, const Decoders& decoders, std::stop_token stop) {
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
    if (auto decoded = decoders.decode(message); !decoded) return decoded.error();
  }
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == info.topics[i].messages) continue;
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: topic {}: got {} messages, wanted {} as the bag says", info.path.string(),
                             info.topics[i].topic.name, counts[i], info.topics[i].messages)};
  }
  return done;
}

}  // namespace

int verify_bag(const std::filesystem::path& bag, std::stop_token stop) {
  const auto reader_result = open_bag(bag, false);
  if (!reader_result) return fail(reader_result.error(), common::kExitFailed);
  CheckedReader& reader = **reader_result;
  const Decoders decoders(reader.info());
  if (auto ok = reader.verify([&](const auto&) { return !stop.stop_requested(); }); !ok) {
    return fail(ok.error(), common::kExitFailed);
  }
  const auto count_result = read_all(reader, decoders, stop);
  if (!count_result) return fail(count_result.error(), common::kExitFailed);
  for (int topic = 0; topic < static_cast<int>(reader.info().topics.size()); ++topic) {
    if (!decoders.has(topic)) fmt::print("not decoded: {}\n", decoders.reason(topic));
  }
  fmt::print("ok: {} messages of {} topics in {} file{}\n", *count_result, reader.info().topics.size(),
             reader.info().files.size(), reader.info().files.size() == 1 ? "" : "s");
  return common::kExitOk;
}

}  // namespace jostle::bags
