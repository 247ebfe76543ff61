#include "services/common/results/journal.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <set>
#include <string_view>
#include <utility>

#include "idl/text/json.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

Error problem(const fs::path& file, const std::string& what) {
  return {Code::kIo, fmt::format("{}: {}: {}", file.string(), what, std::strerror(errno))};
}

}  // namespace

Result<std::unique_ptr<Journal>> Journal::open(const fs::path& file, const json& origin) {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor < 0) return problem(file, "cannot be opened");
  std::unique_ptr<Journal> journal(new Journal(file, descriptor));
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    return Error{Code::kUnavailable,
                 fmt::format("{}: another process writes to it; wait for it, or give another file", file.string())};
  }
  if (auto ok = journal->read(origin); !ok) return ok.error();
  return journal;
}

Journal::~Journal() { close(descriptor_); }

Result<void> Journal::read(const json& origin) {
  std::string bytes;
  char piece[65536];
  for (ssize_t count = 0; (count = pread(descriptor_, piece, sizeof piece, static_cast<off_t>(bytes.size()))) != 0;) {
    if (count < 0) return problem(file_, "cannot be read");
    bytes.append(piece, static_cast<std::size_t>(count));
  }
  std::string_view text = bytes;
  const std::size_t whole = text.rfind('\n') + 1;  // 0 if there is none
  if (whole < text.size() && ftruncate(descriptor_, static_cast<off_t>(whole)) != 0)
    return problem(file_, "cannot be cut off behind its last line");
  text = text.substr(0, whole);
  if (text.empty()) {
    const fs::path folder = file_.has_parent_path() ? file_.parent_path() : ".";
    if (const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); opened >= 0) {
      fsync(opened);  // so that the file itself stays
      close(opened);
    }
    return write({{"origin", origin}});
  }
  for (bool is_first = true; !text.empty(); is_first = false) {
    const std::size_t end = text.find('\n');
    const auto line_result = parse_json(text.substr(0, end));
    const json line = line_result ? *line_result : json();
    text.remove_prefix(end + 1);
    if (is_first) {
      if (!line.is_object() || !line.contains("origin"))
        return Error{Code::kInvalidArgument, fmt::format("{}: it is no journal", file_.string())};
      const std::string difference = first_difference(line["origin"], origin);
      if (!difference.empty())
        return Error{Code::kInvalidArgument, fmt::format("{}: its runs are others: {}", file_.string(), difference)};
    } else if (line.is_object() && line.contains("key") && line["key"].is_string() && line.contains("part")) {
      found_[line["key"]] = line["part"];
    }  // a damaged line is a part that is done again
  }
  return {};
}

Result<void> Journal::append(const std::string& key, const json& part) { return write({{"key", key}, {"part", part}}); }

Result<void> Journal::write(const json& line) {
  const std::string text = line.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
  const std::lock_guard lock(mutex_);
  const off_t before = lseek(descriptor_, 0, SEEK_END);
  if (::write(descriptor_, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(descriptor_) == 0)
    return {};
  const Error error = problem(file_, "cannot be written");
  if (ftruncate(descriptor_, before) != 0) return error;  // half a line would spoil the next one
  return error;
}

void Journal::remove() {
  std::error_code ignored;
  fs::remove(file_, ignored);
}

std::string first_difference(const json& got, const json& wanted, const std::string& where) {
  if (got == wanted) return "";
  if (!got.is_object() || !wanted.is_object())
    return fmt::format("{}: got {}, wanted {}", where, got.dump(), wanted.dump());
  std::set<std::string> keys;
  for (const json* side : {&got, &wanted}) {
    for (const auto& [key, value] : side->items()) keys.insert(key);
  }
  for (const std::string& key : keys) {
    const std::string inner = where.empty() ? key : fmt::format("{}.{}", where, key);
    std::string difference = first_difference(got.value(key, json()), wanted.value(key, json()), inner);
    if (!difference.empty()) return difference;
  }
  return "";
}

}  // namespace jostle::common
