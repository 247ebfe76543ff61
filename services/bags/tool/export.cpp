#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <set>
#include <unordered_map>

#include "services/bags/format/folder_reader.hpp"
#include "services/bags/tool/commands.hpp"
#include "services/bags/tool/decoders.hpp"
#include "services/common/process/program.hpp"
#include "services/common/terminal/progress_line.hpp"

namespace jostle::bags {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// More columns than that nobody looks at: the array becomes one cell.
constexpr std::size_t kWidest = 64;

// A file of the user's, or standard output. One that was not finished goes again.
class Output {
 public:
  static Result<std::unique_ptr<Output>> open(const std::string& path) {
    auto output = std::unique_ptr<Output>(new Output);
    output->path_ = path;
    // A device or a pipe is written to as it is; a file that is there is somebody's.
    std::error_code ignored;
    const fs::file_status status = fs::status(path, ignored);
    output->is_ours_ = path != "-" && (!fs::exists(status) || fs::is_regular_file(status));
    output->file_ = path == "-" ? stdout : std::fopen(path.c_str(), output->is_ours_ ? "wxe" : "we");
    if (output->file_ == nullptr) {
      const bool is_there = errno == EEXIST;
      return Error{is_there ? Code::kInvalidArgument : Code::kIo,
                   is_there ? fmt::format("{}: got a file that is there, wanted a new name", path)
                            : fmt::format("{}: cannot be made", path)};
    }
    return output;
  }
  ~Output() {
    if (file_ == nullptr || file_ == stdout) return;
    std::fclose(file_);
    std::error_code ignored;
    if (is_ours_) fs::remove(path_, ignored);
  }

  void write(const std::string& text) { std::fwrite(text.data(), 1, text.size(), file_); }

  Result<void> finish() {
    const bool was_written = std::ferror(file_) == 0 && std::fflush(file_) == 0;
    if (!was_written) {
      return Error{Code::kIo, fmt::format("{}: cannot be written", path_ == "-" ? "standard output" : path_)};
    }
    if (file_ != stdout) std::fclose(file_);
    file_ = nullptr;
    return {};
  }

 private:
  Output() = default;
  std::string path_;
  std::FILE* file_ = nullptr;
  bool is_ours_ = false;  // a new file, which goes again
};

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

// A cell as RFC 4180 has it.
std::string cell(const Json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) return fmt::format("{}", value.get<double>());
  std::string text = value.is_string() ? value.get<std::string>() : dump(value);
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

// The columns of one topic: every field that any message has, an array's elements side by side.
class Columns {
 public:
  // Calls on_cell(name, value) for every cell of a message.
  template <class OnCell>
  void flatten(const Json& value, const std::string& name, OnCell& on_cell) const {
    if (value.is_object()) {
      for (const auto& [key, part] : value.items())
        flatten(part, name.empty() ? key : fmt::format("{}.{}", name, key), on_cell);
    } else if (value.is_array() && !wide_.contains(name)) {
      for (std::size_t i = 0; i < value.size(); ++i) flatten(value[i], fmt::format("{}[{}]", name, i), on_cell);
    } else {
      on_cell(name, value);
    }
  }

  void add(const Json& message) {
    find_wide(message, "");
    std::size_t after = 0;  // where the next new one goes
    const auto on_cell = [&](const std::string& name, const Json&) {
      const auto known = places_.find(name);
      if (known != places_.end()) {
        after = known->second + 1;
        return;
      }
      names_.insert(names_.begin() + static_cast<std::ptrdiff_t>(after), name);
      for (std::size_t i = after; i < names_.size(); ++i) places_[names_[i]] = i;
      ++after;
    };
    flatten(message, "", on_cell);
  }

  // Once all messages are known: columns of arrays that turned out to be wide go.
  void finish() {
    std::erase_if(names_, [&](const std::string& name) {
      for (std::size_t at = name.find('['); at != std::string::npos; at = name.find('[', at + 1)) {
        if (wide_.contains(name.substr(0, at))) return true;
      }
      return false;
    });
    places_.clear();
    for (std::size_t i = 0; i < names_.size(); ++i) places_[names_[i]] = i;
  }

  std::string head() const {
    std::string line = "time_s,log_time_ns,publish_time_ns";
    for (const std::string& name : names_) line.append(",").append(cell(name));
    return line + "\r\n";
  }

  std::string row(const Message& message, Time start, const Json& value) const {
    std::vector<std::string> cells(names_.size());
    const auto on_cell = [&](const std::string& name, const Json& part) { cells[places_.at(name)] = cell(part); };
    flatten(value, "", on_cell);
    std::string line = fmt::format("{:.9f},{},{}", 1e-9 * static_cast<double>(message.log_time - start),
                                   message.log_time, message.publish_time);
    for (const std::string& text : cells) line.append(",").append(text);
    return line + "\r\n";
  }

 private:
  void find_wide(const Json& value, const std::string& name) {
    if (value.is_object()) {
      for (const auto& [key, part] : value.items())
        find_wide(part, name.empty() ? key : fmt::format("{}.{}", name, key));
    } else if (value.is_array() && !wide_.contains(name)) {
      if (value.size() > kWidest) {
        wide_.insert(name);
        return;
      }
      for (std::size_t i = 0; i < value.size(); ++i) {
        if (value[i].is_structured()) find_wide(value[i], fmt::format("{}[{}]", name, i));
      }
    }
  }

  std::vector<std::string> names_;
  std::unordered_map<std::string, std::size_t> places_;
  std::set<std::string> wide_;
};

struct Selection {
  std::vector<int> topics;
  Time from = 0, to = 0;
};

Result<void> check_times(const ExportArguments& arguments, const BagInfo& info) {
  const double length = 1e-9 * static_cast<double>(info.end - info.start);
  const auto wrong = [](const char* option, double got, const std::string& wanted) {
    return Error{Code::kNotFound, fmt::format("{}: got {:g} s, wanted {}", option, got, wanted)};
  };
  for (const auto& [option, value] : {std::pair{"--from", arguments.from}, {"--to", arguments.to}}) {
    if (value && !std::isfinite(*value)) return wrong(option, *value, "a number of seconds");
  }
  if (arguments.from && *arguments.from > length) {
    return wrong("--from", *arguments.from, fmt::format("at most {:g} s, where the last message is", length));
  }
  if (arguments.to && *arguments.to < arguments.from.value_or(0.0)) {
    return wrong("--to", *arguments.to, fmt::format("at least the {:g} s of --from", arguments.from.value_or(0.0)));
  }
  return {};
}

Result<Selection> select(const ExportArguments& arguments, const BagInfo& info, const Decoders& decoders) {
  Selection selection;
  if (auto ok = check_times(arguments, info); !ok) return ok.error();
  // The bag's own times lie between 1970 and 2262, and so do those between its first and last.
  const auto at = [&](double seconds) {
    const double length = 1e-9 * static_cast<double>(info.end - info.start);
    return seconds >= length ? info.end : info.start + static_cast<Time>(std::llround(std::max(seconds, 0.0) * 1e9));
  };
  selection.from = arguments.from ? at(*arguments.from) : info.start;
  selection.to = arguments.to ? at(*arguments.to) : info.end;
  bool is_any = false;
  for (int topic = 0; topic < static_cast<int>(info.topics.size()); ++topic) {
    const std::string& name = info.topics[static_cast<std::size_t>(topic)].topic.name;
    const bool is_wanted =
        arguments.topics.empty() || std::ranges::any_of(arguments.topics, [&](const std::string& pattern) {
          return fnmatch(pattern.c_str(), name.c_str(), 0) == 0;
        });
    if (!is_wanted) continue;
    is_any = true;
    if (decoders.has(topic)) {
      selection.topics.push_back(topic);
    } else {
      tell("left out: " + decoders.reason(topic));
    }
  }
  if (!is_any && !arguments.topics.empty()) {
    return Error{Code::kNotFound,
                 fmt::format("--topic: got {}, wanted a pattern of a topic that `jostle bag info` shows",
                             fmt::join(arguments.topics, " "))};
  }
  if (selection.topics.empty()) {
    return Error{Code::kInvalidArgument, fmt::format("{}: no topic can be decoded", info.path.string())};
  }
  return selection;
}

// Calls use(message, decoded) -> void for every message of the selection that decodes; tells `undecoded` of the others.
template <class Use>
Result<void> for_each(BagReader& reader, const Decoders& decoders, const Selection& selection, const char* what,
                      Findings& undecoded, std::stop_token stop, Use use) {
  std::uint64_t total = 0, done = 0;
  for (const int topic : selection.topics) total += reader.info().topics[static_cast<std::size_t>(topic)].messages;
  common::ProgressLine progress({.doing = what, .unit = "messages", .wiped = true});
  reader.seek(selection.from, selection.topics);
  while (true) {
    if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    progress.show(done++, total);
    auto message_result = reader.next();
    if (!message_result) return message_result.error();
    if (!*message_result || (*message_result)->log_time > selection.to) return {};
    auto json_result = decoders.decode(**message_result);
    if (json_result) {
      use(**message_result, *json_result);
      continue;
    }
    const std::string& name = reader.info().topics[static_cast<std::size_t>((*message_result)->topic)].topic.name;
    undecoded.lost(Part::kMessage, name + " cannot be decoded", json_result.error().message);
  }
}

Result<void> export_json(BagReader& reader, const Decoders& decoders, const Selection& selection,
                         const std::string& path, Findings& undecoded, std::stop_token stop) {
  auto output_result = Output::open(path);
  if (!output_result) return output_result.error();
  auto ok = for_each(
      reader, decoders, selection, "exporting", undecoded, stop, [&](const Message& message, const Json& json) {
        const Json line{{"topic", reader.info().topics[static_cast<std::size_t>(message.topic)].topic.name},
                        {"log_time", message.log_time},
                        {"publish_time", message.publish_time},
                        {"sequence", message.sequence},
                        {"message", json}};
        (*output_result)->write(dump(line) + "\n");
      });
  return ok ? (*output_result)->finish() : ok;
}

// "/robot/status" is robot_status.csv; a second topic that would be, "/robot_status", is robot_status_2.csv.
class FileNames {
 public:
  std::string name_for(const std::string& topic) {
    constexpr std::size_t kLongest = 200;  // bytes, of the 255 that a file system takes
    std::string name = topic.substr(std::min(topic.find_first_not_of('/'), topic.size())).substr(0, kLongest);
    for (char& c : name) {
      if (c == '/' || static_cast<unsigned char>(c) < ' ') c = '_';
    }
    if (name.empty()) name = "topic";
    std::string unique = name;
    for (int number = 2; !taken_.insert(unique).second; ++number) unique = fmt::format("{}_{}", name, number);
    return unique + ".csv";
  }

 private:
  std::set<std::string> taken_;
};

// A folder that is there may hold something else, a bag for one.
Result<void> check_folder(const std::string& folder) {
  std::error_code problem;
  if (folder == "-" || !fs::exists(folder, problem) || fs::is_empty(folder, problem)) return {};
  return Error{Code::kInvalidArgument,
               fmt::format("--output: got {}, which is there, wanted a new or an empty folder", folder)};
}

Result<void> check_tables(const Selection& selection, const std::string& folder) {
  if (folder == "-" && selection.topics.size() > 1) {
    return Error{Code::kInvalidArgument,
                 fmt::format("--csv to standard output: got {} topics, wanted one; remedy: --topic, or --output FOLDER",
                             selection.topics.size())};
  }
  return check_folder(folder);
}

Result<void> export_csv(BagReader& reader, const Decoders& decoders, const Selection& selection,
                        const std::string& folder, Findings& undecoded, std::stop_token stop) {
  std::map<int, Columns> columns;
  auto ok = for_each(reader, decoders, selection, "looking for columns", undecoded, stop,
                     [&](const Message& message, const Json& json) { columns[message.topic].add(json); });
  if (!ok) return ok;
  std::error_code problem;
  const bool is_new = folder != "-" && fs::create_directories(folder, problem);
  if (problem) return Error{Code::kIo, fmt::format("{}: cannot be made: {}", folder, problem.message())};
  std::map<int, std::unique_ptr<Output>> outputs;
  FileNames names;
  Findings known;  // the same again
  const auto write_all = [&]() -> Result<void> {
    for (auto& [topic, found] : columns) {
      found.finish();
      const std::string name = names.name_for(reader.info().topics[static_cast<std::size_t>(topic)].topic.name);
      auto output_result = Output::open(folder == "-" ? "-" : (fs::path(folder) / name).string());
      if (!output_result) return output_result.error();
      (*output_result)->write(found.head());
      outputs[topic] = std::move(*output_result);
    }
    auto written =
        for_each(reader, decoders, selection, "exporting", known, stop, [&](const Message& message, const Json& json) {
          outputs[message.topic]->write(columns[message.topic].row(message, reader.info().start, json));
        });
    for (auto& [topic, output] : outputs) {
      if (written) written = output->finish();
    }
    return written;
  };
  ok = write_all();
  outputs.clear();
  if (!ok && is_new) fs::remove(folder, problem);  // if it is empty
  return ok;
}

}  // namespace

int export_bag(const ExportArguments& arguments, std::stop_token stop) {
  const auto messages_result = message_files(arguments.messages);
  if (!messages_result) return fail(messages_result.error(), common::kExitUsage);
  const auto reader_result = open_bag(arguments.bag, false, stop);
  if (!reader_result) return fail(reader_result.error(), common::kExitUsage);
  if ((*reader_result)->info().messages == 0) tell("got no messages that can be exported");
  const Decoders decoders((*reader_result)->info(), *messages_result);
  const auto selection_result = select(arguments, (*reader_result)->info(), decoders);
  if (!selection_result) return fail(selection_result.error(), common::kExitFailed);
  if (arguments.as_csv) {
    if (auto ok = check_tables(*selection_result, arguments.output); !ok) return fail(ok.error(), common::kExitUsage);
  }
  Findings undecoded;
  const auto ok = (arguments.as_csv ? export_csv : export_json)(**reader_result, decoders, *selection_result,
                                                                arguments.output, undecoded, stop);
  for (const Finding& finding : (*reader_result)->findings()) tell(finding.text());
  for (const Finding& finding : undecoded.list()) tell(finding.text());
  if (ok) return undecoded.empty() ? common::kExitOk : common::kExitFailed;
  return fail(ok.error(), ok.error().code == Code::kInvalidArgument ? common::kExitFailed : common::kExitBroken);
}

}  // namespace jostle::bags
