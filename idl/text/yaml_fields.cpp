#include "idl/text/yaml_fields.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cstddef>

#include "idl/files/files.hpp"
#include "idl/text/nearest.hpp"

namespace jostle::yaml {
namespace {

constexpr std::size_t kMostComplaints = 20;  // that somebody reads at once
constexpr std::size_t kMostNoted = 1000;     // beyond which reading ends: they are compared with one another
constexpr std::size_t kMostShown = 60;       // characters of a value

std::string key_text(const YAML::Node& key) { return key.IsScalar() ? key.Scalar() : ""; }

std::string shortened(const std::string& text) {
  return text.size() <= kMostShown ? text : text.substr(0, kMostShown) + "…";
}

// Counts values down from `left`; says what is too much of a tree. An alias is the node it stands for, and may stand
// for what it lies in.
std::string size_trouble(const YAML::Node& node, int depth, int& left) {
  if (depth > kMostDepth) return fmt::format("lists and mappings lie more than {} deep in each other", kMostDepth);
  if (--left < 0) return fmt::format("more than {} values, aliases counted as often as they are used", kMostValues);
  if (!node.IsSequence() && !node.IsMap()) return "";
  std::string trouble;
  for (const auto& entry : node) {
    if (node.IsMap()) trouble = size_trouble(entry.first, depth + 1, left);
    if (trouble.empty()) trouble = size_trouble(node.IsMap() ? entry.second : entry, depth + 1, left);
    if (!trouble.empty()) break;
  }
  return trouble;
}

// How many bytes the character in front has; 0 if it is none of UTF-8 (RFC 3629).
std::size_t character_size(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const unsigned first = byte(0), second = byte(1);
  if (first < 0x80) return 1;
  const std::size_t size = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  const unsigned least = first == 0xE0 ? 0xA0 : first == 0xF0 ? 0x90 : 0x80;  // else a shorter form would do
  const unsigned most = first == 0xED ? 0x9F : first == 0xF4 ? 0x8F : 0xBF;   // surrogates; beyond Unicode
  if (first < 0xC2 || first > 0xF4 || second < least || second > most) return 0;
  for (std::size_t i = 2; i < size; ++i) {
    if (byte(i) < 0x80 || byte(i) > 0xBF) return 0;
  }
  return size;
}

// The line from 1 of the first byte that is no UTF-8; 0 if all are. Names end up in JSON, which has nothing else.
int line_without_utf8(std::string_view text) {
  int line = 1;
  while (!text.empty()) {
    const std::size_t size = character_size(text);
    if (size == 0) return line;
    line += text.front() == '\n' ? 1 : 0;
    text.remove_prefix(size);
  }
  return 0;
}

// The first line from 1 that is indented with a tab; 0 if none is.
int line_with_tab(std::string_view text) {
  int line = 0;
  while (!text.empty()) {
    ++line;
    const std::size_t end = text.find('\n');
    const std::string_view indentation = text.substr(0, std::min(text.find_first_not_of(" \t"), end));
    if (indentation.find('\t') != indentation.npos) return line;
    text.remove_prefix(end == text.npos ? text.size() : end + 1);
  }
  return 0;
}

}  // namespace

int line_of(YAML::Node node, std::string_view field) {
  int line = node.Mark().line + 1;
  while (!field.empty() && (node.IsMap() || node.IsSequence())) {
    const std::size_t end = field.find_first_of(".[");
    const std::string key(field.substr(0, end));
    field = end == field.npos ? "" : field.substr(end + 1);
    std::size_t index = 0;
    const auto [rest, problem] = std::from_chars(key.data(), key.data() + key.size(), index);
    const bool is_index = problem == std::errc() && *rest == ']';  // names, too, may have brackets
    const YAML::Node next = is_index ? node[index] : node[key];
    if (!next) break;
    node.reset(next);
    line = node.Mark().line + 1;
  }
  return line;
}

std::string quoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

void Complaints::add(int line, const std::string& field, const std::string& problem, const std::string& shown) {
  complaints_.push_back({.line = line,
                         .field = field,
                         .text = fmt::format("{}: {}", shown.empty() ? field : shown, problem),
                         .is_missing = false,
                         .is_explained = false});
  if (complaints_.size() >= kMostNoted) fail();
}

void Complaints::add_missing(int line, const std::string& field, const std::string& wanted) {
  add(line, field, "missing, wanted " + wanted);
  complaints_.back().is_missing = true;
}

void Complaints::not_missing(const std::string& field) {
  for (Complaint& complaint : complaints_) {
    if (complaint.is_missing && complaint.field == field) complaint.is_explained = true;
  }
}

bool Complaints::is_sound(std::string_view part) const {
  return std::ranges::none_of(complaints_, [&](const Complaint& complaint) {
    const std::string_view field = complaint.field;
    return field.starts_with(part) &&
           (part.empty() || field.size() == part.size() || field[part.size()] == '.' || field[part.size()] == '[');
  });
}

void Complaints::fail() const {
  std::vector<const Complaint*> sorted;
  for (const Complaint& complaint : complaints_) {
    if (!complaint.is_explained) sorted.push_back(&complaint);
  }
  std::ranges::stable_sort(sorted, {}, &Complaint::line);
  std::string message;
  for (std::size_t i = 0; i < std::min(sorted.size(), kMostComplaints); ++i) {
    message += fmt::format("{}{}:{}: {}", i == 0 ? "" : "\n", origin_, sorted[i]->line, sorted[i]->text);
  }
  if (sorted.size() > kMostComplaints)
    message += fmt::format("\n{}: and {} more", origin_, sorted.size() - kMostComplaints);
  throw Malformed{message};
}

Fields::Fields(const YAML::Node& node, std::string path, const std::string& origin)
    : node_(node), path_(std::move(path)), complaints_(std::make_shared<Complaints>(origin)) {
  if (node_.IsMap()) return;
  unwanted(node_, path_.empty() ? "file" : path_, "a mapping of keys to values");
  complaints_->fail();
}

void Fields::pairs(const char* key, std::vector<std::pair<std::string, double>>& values) {
  const YAML::Node node = take(key);
  if (!node) return;
  if (!node.IsMap()) return unwanted(node, name(key), "a mapping of names to numbers");
  for (const auto& entry : node) {
    double value = 0.0;
    read(entry.second, name(key) + "." + key_text(entry.first), value);
    values.emplace_back(key_text(entry.first), value);
  }
}

void Fields::refuse(const char* key, const std::string& problem) const {
  const YAML::Node node = node_[key];
  complaints_->add(line(node ? node : node_), name(key), problem);
  if (is_root_) complaints_->fail();
  throw Ended{};
}

void Fields::finish() {
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    const std::string key = key_text(entry.first);
    const int here = line(entry.first);
    if (!entry.first.IsScalar()) {
      complaints_->add(here, name("?"), fmt::format("got {} as a key, wanted a word", describe(entry.first)));
    } else if (!seen.insert(key).second) {
      complaints_->add(here, name(key), "given twice, wanted once");
    } else if (!known_.contains(key)) {
      const std::string meant = nearest(key, known_);
      const bool is_misspelt = !meant.empty() && !has(meant.c_str());
      if (is_misspelt) complaints_->not_missing(name(meant));
      complaints_->add(here, name(shortened(key)),
                       is_misspelt ? fmt::format("unknown key {}, did you mean {}?", shortened(key), meant)
                                   : fmt::format("unknown key, wanted one of: {}", fmt::join(known_, ", ")));
    }
  }
  if (is_root_ && !complaints_->empty()) complaints_->fail();
}

std::string Fields::describe(const YAML::Node& node) {
  if (node.IsScalar()) return "'" + shortened(node.Scalar()) + "'";
  if (node.IsSequence()) return fmt::format("a list of {}", node.size());
  return node.IsMap() ? "a mapping" : "nothing";
}

bool Fields::is_infinite(std::string_view text) {
  std::string word(text);
  word.erase(0, std::min(word.find_first_not_of("+-."), word.size()));
  std::ranges::transform(word, word.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  double value = 0.0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_too_large = problem == std::errc::result_out_of_range && end == text.data() + text.size();
  return is_too_large || word == "inf" || word == "infinity" || word == "nan";
}

bool Fields::is_yes_or_no(const std::string& text, bool& value) {
  std::string word = text;
  std::ranges::transform(word, word.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const bool is_yes = word == "true" || word == "yes" || word == "on";
  if (!is_yes && word != "false" && word != "no" && word != "off") return false;
  value = is_yes;
  return true;
}

void Fields::unwanted(const YAML::Node& node, const std::string& field, const std::string& wanted_here) {
  complaints_->add(line(node), field, fmt::format("got {}, wanted {}", describe(node), wanted_here));
}

YAML::Node Fields::take(const char* key) {
  known_.insert(key);
  const YAML::Node found = node_[key];
  return found ? found : YAML::Node(YAML::NodeType::Undefined);
}

Error not_yaml(const YAML::Exception& error, const std::string& origin, std::string_view text) {
  if (const int line = line_with_tab(text); line > 0) {
    return {Code::kInvalidArgument,
            fmt::format("{}:{}: got a tab in the indentation, wanted blanks: YAML allows no others", origin, line)};
  }
  return {Code::kInvalidArgument, fmt::format("{}:{}: not YAML: {}", origin, error.mark.line + 1, error.msg)};
}

Result<YAML::Node> load(std::string_view text, const std::string& origin) {
  const auto refused = [&](const std::string& trouble) {
    return Error{Code::kInvalidArgument, fmt::format("{}: {}", origin, trouble)};
  };
  if (text.size() > files::kMostText)
    return refused(fmt::format("got {} bytes, wanted at most {}", text.size(), files::kMostText));
  if (const int line = line_without_utf8(text); line > 0)
    return Error{Code::kInvalidArgument, fmt::format("{}:{}: got bytes that are no UTF-8, wanted text", origin, line)};
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(std::string(text));
    if (documents.empty()) return YAML::Node();
    if (documents.size() > 1) return refused(fmt::format("got {} YAML documents, wanted one", documents.size()));
    int left = kMostValues;
    if (const std::string trouble = size_trouble(documents.front(), 0, left); !trouble.empty())
      return refused("got " + trouble);
    return documents.front();
  } catch (const YAML::Exception& error) {
    return not_yaml(error, origin, text);
  }
}

}  // namespace jostle::yaml
