#include "services/bags/format/message_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string_view>
#include <utility>

#include "idl/files/files.hpp"
#include "services/bags/format/definitions.hpp"

namespace jostle::bags {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostParts = 1000;  // types that one is made of

bool is_basic(const std::string& type) {
  static const std::set<std::string, std::less<>> kBasic{"bool",   "byte",   "char",    "uint8",   "int8",
                                                         "uint16", "int16",  "uint32",  "int32",   "uint64",
                                                         "int64",  "string", "float32", "float64", "wstring"};
  return kBasic.contains(type);
}

// The package and name of what a line of a file in `package` has as its type: "Pose[<=3]", "pkg/Pose", "Header".
// Nothing for a basic type, a comment, a constant of a basic type.
std::optional<std::pair<std::string, std::string>> part_of(const std::string& package, const std::string& line) {
  std::istringstream in(line.substr(0, line.find('#')));
  std::string type;
  in >> type;
  type.resize(std::min(type.find('['), type.size()));
  type.resize(std::min(type.find("<="), type.size()));
  if (type.empty() || is_basic(type)) return {};
  if (type == "time" || type == "duration")
    return std::pair{"builtin_interfaces", type == "time" ? "Time" : "Duration"};
  const std::size_t slash = type.find('/');
  if (slash == std::string::npos) return std::pair{type == "Header" ? "std_msgs" : package, type};
  return std::pair{type.substr(0, slash), type.substr(type.rfind('/') + 1)};
}

// Names that come from elsewhere become paths: nothing else may be in them.
bool is_name(const std::string& text) {
  static const std::regex kName(R"([A-Za-z]\w*)");
  return std::regex_match(text, kName);
}

std::optional<fs::path> file_in(const fs::path& folder, const std::string& package, const std::string& name) {
  std::vector<fs::path> candidates{folder / package / "msg" / (name + ".msg"),
                                   folder / "share" / package / "msg" / (name + ".msg")};
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(folder, ignored);
  if (whole.filename() == package) candidates.push_back(whole / "msg" / (name + ".msg"));
  for (const fs::path& candidate : candidates) {
    if (fs::is_regular_file(candidate, ignored)) return candidate;
  }
  return {};
}

// The first part of what definition_of() returns: the type's own file.
std::optional<std::string> known_text(const std::string& package, const std::string& name) {
  auto definition = definition_of(package + "/msg/" + name);
  if (definition) definition->resize(std::min(definition->find(std::string(80, '=')), definition->size()));
  return definition;
}

}  // namespace

MessageFiles::MessageFiles(std::vector<fs::path> folders) : own_(std::move(folders)) {
  const char* list = std::getenv("AMENT_PREFIX_PATH");
  std::istringstream in(list ? list : "");
  for (std::string folder; std::getline(in, folder, ':');) {
    if (!folder.empty()) installed_.emplace_back(folder);
  }
}

Result<std::string> MessageFiles::definition(const std::string& type) const {
  static const std::regex kType(R"((\w+)/msg/(\w+))");
  std::smatch match;
  if (!std::regex_match(type, match, kType))
    return Error{Code::kNotFound, fmt::format("type: got '{}', wanted a message, pkg/msg/Name", type)};
  auto text_result = text_of(match.str(1), match.str(2));
  if (!text_result) return text_result;
  std::string definition = std::move(text_result).value();
  std::vector<std::string> parts;
  const std::string whole = definition;
  if (auto ok = collect(match.str(1), whole, parts, definition); !ok) return ok.error();
  if (const auto decoder_result = Decoder::create(type, definition); !decoder_result) return decoder_result.error();
  return definition;
}

Result<void> MessageFiles::collect(const std::string& package, const std::string& text, std::vector<std::string>& parts,
                                   std::string& definition) const {
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    const auto part = part_of(package, line);
    if (!part) continue;
    const std::string name = part->first + "/" + part->second;
    if (std::ranges::count(parts, name) > 0) continue;
    if (parts.size() == kMostParts)
      return Error{Code::kInvalidArgument, fmt::format("{}: got a type of more than {} others", package, kMostParts)};
    auto text_result = text_of(part->first, part->second);
    if (!text_result) return text_result.error();
    parts.push_back(name);
    definition += fmt::format("{}\nMSG: {}\n{}", std::string(80, '='), name, *text_result);
    if (auto ok = collect(part->first, *text_result, parts, definition); !ok) return ok;
  }
  return {};
}

Result<std::string> MessageFiles::text_of(const std::string& package, const std::string& name) const {
  std::optional<fs::path> file;
  if (is_name(package) && is_name(name)) {
    for (const fs::path& folder : own_) {
      if (!file) file = file_in(folder, package, name);
    }
    if (!file) {
      if (auto known = known_text(package, name)) return *std::move(known);
    }
    for (const fs::path& folder : installed_) {
      if (!file) file = file_in(folder, package, name);
    }
  }
  if (!file) {
    std::vector<std::string> tried;
    for (const auto* folders : {&own_, &installed_}) {
      for (const fs::path& folder : *folders) tried.push_back(folder.string());
    }
    return Error{
        Code::kNotFound,
        fmt::format("{}/msg/{}: got no such file, wanted {}/msg/{}.msg{}; remedy: --messages FOLDER, or "
                    "AMENT_PREFIX_PATH",
                    package, name, package, name, tried.empty() ? "" : fmt::format(" in {}", fmt::join(tried, ", ")))};
  }
  auto text_result = files::read(*file, files::kMostText);
  if (text_result && !text_result->ends_with('\n')) *text_result += '\n';
  return text_result;
}

Result<MessageFiles> message_files(const std::vector<std::string>& folders) {
  for (const std::string& folder : folders) {
    std::error_code ignored;
    if (!fs::is_directory(folder, ignored))
      return Error{Code::kNotFound, fmt::format("--messages: got {}, wanted a folder that is there", folder)};
  }
  return MessageFiles({folders.begin(), folders.end()});
}

}  // namespace jostle::bags
