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

// Copies a bag as far as it can be read, and counts what was taken.
class Copy {
 public:
  Copy(CheckedReader& from, BagWriter& to, std::stop_token stop) : from_(from), to_(to), stop_(std::move(stop)) {}

  Result<void> make() {
    const BagInfo& info = from_.info();
    for (const auto& [name, note] : info.notes) to_.set_note(name, note);
    for (const NamedNote& note : info.earlier_notes) {
      if (auto ok = keep(to_.add_note(note), Part::kNote); !ok) return ok;
    }
    notes_ += info.notes.size();
    for (std::size_t i = 0; i < info.attachments.size(); ++i) {
      auto attachment_result = from_.attachment(i);
      if (!attachment_result) {
        lost_.lost(Part::kAttachment, attachment_result.error().message, "");
      } else if (auto ok = keep(to_.attach(*attachment_result), Part::kAttachment); !ok) {
        return ok;
      }
    }
    return copy_messages();
  }

  std::uint64_t messages() const { return messages_; }
  std::uint64_t notes() const { return notes_; }
  std::uint64_t attachments() const { return attachments_; }
  const Findings& lost() const { return lost_; }

 private:
  Result<void> copy_messages() {
    std::vector<int> topics;
    for (const TopicInfo& topic : from_.info().topics) {
      auto index_result = to_.add_topic(topic.topic);
      if (!index_result) return index_result.error();
      topics.push_back(*index_result);
    }
    common::ProgressLine progress({.doing = "recovering", .unit = "messages", .wiped = true});
    while (true) {
      if (stop_.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      progress.show(messages_, from_.info().messages);
      auto message_result = from_.next();
      if (!message_result) return message_result.error();
      if (!*message_result) return {};
      const Message& message = **message_result;
      if (auto ok = to_.write(topics[static_cast<std::size_t>(message.topic)], message.view()); !ok) return ok;
      ++messages_;
    }
  }

  // What the new bag has no room for is lost; that it cannot be written ends everything.
  Result<void> keep(const Result<void>& kept, Part part) {
    if (!kept && kept.error().code != Code::kInvalidArgument) return kept;
    if (!kept) {
      lost_.lost(part, kept.error().message, "");
    } else {
      ++(part == Part::kNote ? notes_ : attachments_);
    }
    return {};
  }

  CheckedReader& from_;
  BagWriter& to_;
  const std::stop_token stop_;
  std::uint64_t messages_ = 0, notes_ = 0, attachments_ = 0;
  Findings lost_;
};

// "2 messages, 1 chunk"
std::string counts_of(const Findings& findings) {
  std::string text;
  for (int i = 0; i < kParts; ++i) {
    const auto part = static_cast<Part>(i);
    const std::uint64_t count = findings.count_lost(part);
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, name_of(part, count));
  }
  return text;
}

}  // namespace

int recover_bag(const RecoverArguments& arguments, std::stop_token stop) {
  auto reader_result = open_bag(arguments.bag, true, stop);
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
  Copy copy(reader, **writer_result, stop);
  const auto copied = copy.make();
  Findings findings;
  findings.add_all(reader.findings());
  findings.add_all(copy.lost().list());
  Note note{{"from", arguments.bag.string()}};
  for (std::size_t i = 0; i < findings.list().size(); ++i) {
    note[fmt::format("damage {}", i + 1)] = findings.list()[i].text();
  }
  (*writer_result)->set_note("recovered", note);
  auto closed = copied ? (*writer_result)->close() : copied;
  if (!closed) {
    writer_result->reset();
    std::error_code ignored;
    fs::remove_all(output, ignored);
    return fail(closed.error(), common::kExitBroken);
  }
  // Who reads this is doing what the remedy says.
  for (const Finding& finding : findings.list()) {
    const std::string text = finding.text();
    fmt::print("damaged: {}\n", text.substr(0, text.find("; remedy: ")));
  }
  if (findings.empty()) fmt::print("nothing is damaged\n");
  fmt::print("{}: {} messages of {} topics, {} attachments, {} notes; {}\n", output.string(), copy.messages(),
             reader.info().topics.size(), copy.attachments(), copy.notes(),
             findings.any_lost() ? "lost: " + counts_of(findings) : "nothing was lost");
  return findings.any_lost() ? common::kExitFailed : common::kExitOk;
}

}  // namespace jostle::bags
