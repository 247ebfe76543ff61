#pragma once
/// \file
/// Strict reading of YAML files: every complaint names file, line, field, what was found and what was wanted, and an
/// unknown key is a misspelt key. A file's mistakes are told all at once, as far as they do not follow from one
/// another.
///
/// One rule says what is a number, in every file (YAML 1.2 without its octal and hexadecimal notations): decimal
/// digits, with a sign, and for numbers that need not be whole with a point or an exponent. 050 is fifty; 0x10, 0o17,
/// 1_000, .inf, .nan, yes and true are no numbers. Yes and no are true, false, yes, no, on and off. Texts are any
/// words, so `name: 050` is a text.

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "idl/types/number.hpp"
#include "idl/types/result.hpp"

namespace jostle::yaml {

/// Thrown by Fields; parse() turns it into an Error.
struct Malformed {
  std::string message;  ///< a line for each complaint
};

/// How deep lists and mappings may lie in each other, and how many values a text may have, aliases counted as often as
/// they are used.
inline constexpr int kMostDepth = 64;
inline constexpr int kMostValues = 1'000'000;
/// Mappings in one list, at most: of objects, links, joints.
inline constexpr std::size_t kMostEntries = 1000;

/// Returns the line, from 1, of a field such as "objects[3].pose.x" in a file's tree. Where the file does not spell
/// the field out, it is the line of the nearest part around it.
int line_of(YAML::Node node, std::string_view field);

/// Quotes a text as YAML (and JSON) do, so that any name survives.
std::string quoted(const std::string& text);

/// What is wrong with one file.
class Complaints {
 public:
  explicit Complaints(std::string origin) : origin_(std::move(origin)) {}

  /// `line`: from 1. `field`: its path, such as "objects[3].pose.x"; `shown`: the same as people like to read it.
  void add(int line, const std::string& field, const std::string& problem, const std::string& shown = "");
  void add_missing(int line, const std::string& field, const std::string& wanted);
  /// Tells no longer that a field is missing: a misspelt key explains it.
  void not_missing(const std::string& field);

  bool empty() const { return complaints_.empty(); }
  /// Whether nothing is wrong with a part such as "objects[3]" or "objects[3].mass" and whatever is in it.
  bool is_sound(std::string_view part) const;
  /// Throws them all as one Malformed, by line; the first twenty if there are more.
  [[noreturn]] void fail() const;

 private:
  struct Complaint {
    int line;
    std::string field, text;
    bool is_missing, is_explained;
  };
  const std::string origin_;
  std::vector<Complaint> complaints_;
};

/// One mapping of a file: hands out its fields and knows which were asked for. What is wrong with a field is noted, its
/// value stays what it was, and reading goes on; the finish() of the whole file throws.
class Fields {
 public:
  /// The file's root. Throws Malformed if it is no mapping.
  Fields(const YAML::Node& node, std::string path, const std::string& origin);

  template <class T>
  void optional(const char* key, T& value) {
    if (const YAML::Node node = take(key)) read(node, name(key), value);
  }

  template <class T>
  void required(const char* key, T& value) {
    if (const YAML::Node node = take(key)) {
      read(node, name(key), value);
    } else {
      complaints_->add_missing(line(node_), name(key), wanted<T>());
    }
  }

  template <std::size_t N>
  void numbers(const char* key, std::array<double, N>& values, bool is_required) {
    const std::string wanted_here = fmt::format("{} numbers", N);
    const YAML::Node node = take(key);
    if (!node) {
      if (is_required) complaints_->add_missing(line(node_), name(key), wanted_here);
    } else if (!node.IsSequence() || node.size() != N) {
      unwanted(node, name(key), wanted_here);
    } else {
      for (std::size_t i = 0; i < N; ++i) read(node[i], fmt::format("{}[{}]", name(key), i), values[i]);
    }
  }

  /// Reads a field that must be one of several words; returns whether it is, or is left out.
  template <class E>
  bool choice(const char* key, E& value, std::initializer_list<std::pair<const char*, E>> words) {
    const YAML::Node node = take(key);
    if (!node) return true;
    std::string known;
    for (const auto& [word, meaning] : words) {
      if (node.IsScalar() && node.Scalar() == word) {
        value = meaning;
        return true;
      }
      known += (known.empty() ? "" : ", ") + std::string(word);
    }
    unwanted(node, name(key), "one of: " + known);
    return false;
  }

  /// Takes fields as they are, because what they should be depends on one that is wrong.
  void skip(std::initializer_list<const char*> keys) { known_.insert(keys.begin(), keys.end()); }

  template <class Reader>
  void section(const char* key, bool is_required, Reader reader) {
    if (const YAML::Node node = take(key)) {
      read_mapping(node, name(key), reader);
    } else if (is_required) {
      complaints_->add_missing(line(node_), name(key), "a mapping");
    }
  }

  bool has(const char* key) const { return static_cast<bool>(node_[key]); }
  bool is_mapping(const char* key) const { return has(key) && node_[key].IsMap(); }
  /// Whether nothing is wrong with this mapping so far.
  bool is_sound() const { return complaints_->is_sound(path_); }
  /// Those of the whole file, for what is wrong with values that are each well formed.
  Complaints& complaints() { return *complaints_; }

  /// Reads a mapping of names to numbers, in the file's order.
  void pairs(const char* key, std::vector<std::pair<std::string, double>>& values);

  /// Says what is wrong with a field that has been read, and ends the reading of this mapping.
  [[noreturn]] void refuse(const char* key, const std::string& problem) const;

  /// Reads a list that may be missing.
  template <class Reader>
  void optional_list(const char* key, Reader reader) {
    if (const YAML::Node node = take(key)) read_list(node, key, reader);
  }

  template <class Reader>
  void list(const char* key, Reader reader) {
    if (const YAML::Node node = take(key)) {
      read_list(node, key, reader);
    } else {
      complaints_->add_missing(line(node_), name(key), "a list");
    }
  }

  /// Refuses keys nobody asked for, and keys given twice. For a whole file: throws Malformed if anything is wrong.
  void finish();

 private:
  struct Ended {};  // a mapping that refuse() gave up, its complaint noted

  Fields(const YAML::Node& node, std::string path, std::shared_ptr<Complaints> complaints)
      : node_(node), path_(std::move(path)), complaints_(std::move(complaints)), is_root_(false) {}

  template <class T>
  static std::string wanted() {
    if constexpr (std::is_same_v<T, std::string>)
      return "text";
    else if constexpr (std::is_same_v<T, bool>)
      return "true or false";
    else if constexpr (std::is_unsigned_v<T>)
      return "a whole number, 0 or more";
    else if constexpr (std::is_integral_v<T>)
      return "a whole number";
    else if constexpr (std::is_floating_point_v<T>)
      return "a number";
    else if constexpr (requires { typename T::mapped_type; })
      return "a mapping";
    else
      return "a list";
  }

  static int line(const YAML::Node& node) { return std::max(node.Mark().line, 0) + 1; }
  static std::string describe(const YAML::Node& node);
  static bool is_infinite(std::string_view text);  // whether it means a number that is not finite
  static bool is_yes_or_no(const std::string& text, bool& value);

  void unwanted(const YAML::Node& node, const std::string& field, const std::string& wanted_here);

  template <class T>
  void read(const YAML::Node& node, const std::string& field, T& value) {
    if constexpr (std::is_same_v<T, std::string>) {
      if (!node.IsScalar()) return unwanted(node, field, wanted<T>());
      value = node.Scalar();
    } else if constexpr (std::is_same_v<T, bool>) {
      if (!node.IsScalar() || !is_yes_or_no(node.Scalar(), value)) unwanted(node, field, wanted<T>());
    } else if constexpr (std::is_arithmetic_v<T>) {
      read_number(node, field, value);
    } else if constexpr (requires { typename T::mapped_type; }) {
      if (!node.IsMap()) return unwanted(node, field, wanted<T>());
      for (const auto& entry : node) {
        const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
        std::string name = field;
        name.append(".").append(key);
        read(entry.second, name, value[key]);
      }
    } else {
      if (!node.IsSequence()) return unwanted(node, field, wanted<T>());
      value.clear();
      for (std::size_t i = 0; i < node.size(); ++i)
        read(node[i], fmt::format("{}[{}]", field, i), value.emplace_back());
    }
  }

  template <class T>
  void read_number(const YAML::Node& node, const std::string& field, T& value) {
    const std::string_view text = node.IsScalar() ? without_plus(node.Scalar()) : std::string_view();
    if constexpr (std::is_floating_point_v<T>) {
      const auto number = parse_number(text);
      if (!number) return unwanted(node, field, is_infinite(text) ? "a finite number" : wanted<T>());
      value = static_cast<T>(*number);
    } else {
      constexpr T kLeast = std::numeric_limits<T>::min(), kMost = std::numeric_limits<T>::max();
      const auto number = parse_whole(text, kLeast, kMost);
      const bool is_large =
          parse_number(text) && text.find_first_not_of("0123456789", text.starts_with('-')) == text.npos;
      if (!number)
        return unwanted(node, field, is_large ? fmt::format("a whole number, {} to {}", kLeast, kMost) : wanted<T>());
      value = *number;
    }
  }

  template <class Reader>
  void read_mapping(const YAML::Node& node, const std::string& field, Reader& reader) {
    if (!node.IsMap()) return unwanted(node, field, "a mapping of keys to values");
    Fields fields(node, field, complaints_);
    try {
      reader(fields);
      fields.finish();
    } catch (const Ended&) {
    }
  }

  template <class Reader>
  void read_list(const YAML::Node& node, const char* key, Reader& reader) {
    if (!node.IsSequence() || node.size() > kMostEntries)
      return unwanted(node, name(key), fmt::format("a list of at most {}", kMostEntries));
    std::size_t i = 0;
    for (const YAML::Node& entry : node) read_mapping(entry, fmt::format("{}[{}]", name(key), i++), reader);
  }

  YAML::Node take(const char* key);
  std::string name(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

  const YAML::Node node_;
  const std::string path_;
  const std::shared_ptr<Complaints> complaints_;  // of the file: all its mappings have the same
  const bool is_root_ = true;
  std::set<std::string> known_;
};

/// Makes the Error of a text that is no YAML.
Error not_yaml(const YAML::Exception& error, const std::string& origin, std::string_view text = "");

/// Returns the tree of a text. Error kInvalidArgument with file and line: it is no YAML, several documents, larger than
/// files::kMostText, or beyond kMostDepth or kMostValues.
Result<YAML::Node> load(std::string_view text, const std::string& origin);

/// Returns what `reader` makes of a tree's root node, a Result<T>. Whatever is malformed
/// becomes an Error of kInvalidArgument that names file and line.
template <class T, class Reader>
Result<T> read(const YAML::Node& root, const std::string& origin, Reader reader) {
  try {
    return reader(root);
  } catch (const Malformed& malformed) {
    return Error{Code::kInvalidArgument, malformed.message};
  } catch (const YAML::Exception& error) {
    return not_yaml(error, origin);
  }
}

/// The same for a text.
template <class T, class Reader>
Result<T> parse(std::string_view text, const std::string& origin, Reader reader) {
  const auto root_result = load(text, origin);
  if (!root_result) return root_result.error();
  return read<T>(*root_result, origin, reader);
}

}  // namespace jostle::yaml
