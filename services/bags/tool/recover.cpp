#include <fmt/format.h>

#include <algorithm>

#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/folder_reader.hpp"
#include "services/bags/tool/commands.hpp"
#include "services/common/process/program.hpp"
#include "services/common/terminal/progress_line.hpp"

namespace jostle::bags {
namespace {

namespace fs = std::filesystem;

fs::path default_output(const fs::path& bag) {
  const fs::path whole = fs::absolute(bag).lexically_normal();
  const fs::path named = whole.has_filename() ? whole : whole.parent_path();
  return named.parent_path() / (named.stem().string() + "-recovered");
}

// Every message that `from` gives out, in its order. How many.
Result<std::uint64_t> copy(CheckedReader& from, BagWriter& to, std::stop_token stop) {
  std::vector<int> topics;
  for (const TopicInfo& topic : from.info().topics) {
    auto index_result = to.add_topic(topic.topic);
    if (!index_result) return index_result.error();
    topics.push_back(*index_result);
  }
  std::uint64_t done = 0;
  common::ProgressLine progress({.doing = "recovering", .unit = "messages", .wiped = true});
  while (true) {
    if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    progress.show(done, from.info().messages);
    auto message_result = from.next();
    if (!message_result) return message_result.error();
    if (!*message_result) return done;
    if (auto ok = to.write(topics[static_cast<std::size_t>((*message_result)->topic)], (*message_result)->view());
        !ok) {
      return ok.error();
    }
    ++done;
  }
}

}  // namespace

int recover_bag(const RecoverArguments& arguments, std::stop_token stop) {
  auto reader_result = open_bag(arguments.bag, true);
  if (!reader_result) return fail(reader_result.error(), common::kExitFailed);
  CheckedReader& reader = **reader_result;
  const fs::path output = arguments.output.empty() ? default_output(arguments.bag) : arguments.output;
  using Storage = BagOptions::Storage;
  auto writer_result =
      BagWriter::create(output, {.storage = reader.info().storage == "mcap" ? Storage::kMcap : Storage::kSqlite});
  if (!writer_result) {
    return fail(writer_result.error(),
                writer_result.error().code == Code::kInvalidArgument ? common::kExitUsage : common::kExitBroken);
  }
  for (const auto& [name, note] : reader.info().notes) (*writer_result)->set_note(name, note);

  const auto count_result = copy(reader, **writer_result, stop);
  const auto damage = reader.damage();
  Note note{{"from", arguments.bag.string()}};
  for (std::size_t i = 0; i < damage.size(); ++i) note[fmt::format("damage {}", i + 1)] = damage[i];
  (*writer_result)->set_note("recovered", note);
  auto closed = count_result ? (*writer_result)->close() : Result<void>(count_result.error());
  if (!closed) {
    writer_result->reset();
    std::error_code ignored;
    fs::remove_all(output, ignored);
    return fail(closed.error(), common::kExitBroken);
  }
  for (const std::string& where : damage) fmt::print("damaged: {}\n", where);
  if (damage.empty()) fmt::print("nothing is damaged\n");
  fmt::print("{}: {} messages of {} topics\n", output.string(), *count_result, reader.info().topics.size());
  return *count_result == 0 && !damage.empty() ? common::kExitFailed : common::kExitOk;
}

}  // namespace jostle::bags
