#pragma once
/// \file
/// Strict reading of YAML files: every complaint names file, line, field, what
/// was found and what was wanted, and an unknown key is a misspelt key.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <charconv>
#include <initializer_list>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::yaml {

/// Thrown by Fields; parse() turns it into an Error.
struct Malformed {
  std::string message;
};

/// Returns the line, from 1, of a field such as "objects[3].pose.x" in a file's tree. Where the file does not spell
/// the field out, it is the line of the nearest part around it.
inline int line_of(YAML::Node node, std::string_view field) {
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

/// Quotes a text as YAML (and JSON) do, so that any name survives.
inline std::string quoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

inline Error not_yaml(const YAML::Exception& error, const std::string& origin) {
  return {Code::kInvalidArgument, fmt::format("{}:{}: not YAML: {}", origin, error.mark.line + 1, error.msg)};
}

/// One mapping of a file: hands out its fields and knows which were asked for.
class Fields {
 public:
  Fields(const YAML::Node& node, std::string path, const std::string& origin)
      : node_(node), path_(std::move(path)), origin_(origin) {
    if (!node_.IsMap()) {
      fail(node_, path_.empty() ? "file" : path_,
           fmt::format("got {}, wanted a mapping of keys to values", describe(node_)));
    }
  }

  template <class T>
  void optional(const char* key, T& value) {
    if (const YAML::Node node = take(key)) value = convert<T>(node, name(key));
  }

  template <class T>
  void required(const char* key, T& value) {
    const YAML::Node node = take(key);
    if (!node) fail(node_, name(key), "missing, wanted " + wanted<T>());
    value = convert<T>(node, name(key));
  }

  template <std::size_t N>
  void numbers(const char* key, std::array<double, N>& values, bool is_required) {
    const YAML::Node node = take(key);
    if (!node) {
      if (is_required) fail(node_, name(key), fmt::format("missing, wanted {} numbers", N));
      return;
    }
    if (!node.IsSequence() || node.size() != N) {
      fail(node, name(key), fmt::format("got {}, wanted {} numbers", describe(node), N));
    }
    for (std::size_t i = 0; i < N; ++i) {
      values[i] = convert<double>(node[i], fmt::format("{}[{}]", name(key), i));
    }
  }

  /// Reads a field that must be one of several words.
  template <class E>
  void choice(const char* key, E& value, std::initializer_list<std::pair<const char*, E>> words) {
    const YAML::Node node = take(key);
    if (!node) return;
    const auto text = convert<std::string>(node, name(key));
    std::string known;
    for (const auto& [word, meaning] : words) {
      if (text == word) {
        value = meaning;
        return;
      }
      known += (known.empty() ? "" : ", ") + std::string(word);
    }
    fail(node, name(key), fmt::format("got '{}', wanted one of: {}", text, known));
  }

  template <class Reader>
  void section(const char* key, bool is_required, Reader read) {
    const YAML::Node node = take(key);
    if (node) {
      Fields fields(node, name(key), origin_);
      read(fields);
      fields.finish();
    } else if (is_required) {
      fail(node_, name(key), "missing, wanted a mapping");
    }
  }

  bool has(const char* key) const { return static_cast<bool>(node_[key]); }
  bool is_mapping(const char* key) const { return node_[key] && node_[key].IsMap(); }

  /// Reads a mapping of names to numbers, in the file's order.
  void pairs(const char* key, std::vector<std::pair<std::string, double>>& values) {
    const YAML::Node node = take(key);
    if (!node) return;
    if (!node.IsMap())
      fail(node, name(key), fmt::format("got {}, wanted a mapping of names to numbers", describe(node)));
    for (const auto& entry : node) {
      const auto word = entry.first.as<std::string>();
      values.emplace_back(word, convert<double>(entry.second, name(key) + "." + word));
    }
  }

  /// Says what is wrong with a field that has been read.
  [[noreturn]] void refuse(const char* key, const std::string& problem) const {
    const YAML::Node node = node_[key];
    fail(node ? node : node_, name(key), problem);
  }

  /// Reads a list that may be missing.
  template <class Reader>
  void optional_list(const char* key, Reader read) {
    if (node_[key]) {
      list(key, read);
    } else {
      known_.insert(key);
    }
  }

  template <class Reader>
  void list(const char* key, Reader read) {
    const YAML::Node node = take(key);
    if (!node || !node.IsSequence()) {
      fail(node ? node : node_, name(key), "wanted a list");
    }
    for (std::size_t i = 0; i < node.size(); ++i) {
      Fields fields(node[i], fmt::format("{}[{}]", name(key), i), origin_);
      read(fields);
      fields.finish();
    }
  }

  /// Refuses keys nobody asked for, and keys given twice.
  void finish() {
    std::set<std::string> seen;
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>();
      if (!seen.insert(key).second) fail(entry.first, name(key.c_str()), "given twice, wanted once");
      if (!known_.contains(key)) {
        fail(entry.first, name(key.c_str()), fmt::format("unknown key, wanted one of: {}", fmt::join(known_, ", ")));
      }
    }
  }

 private:
  template <class T>
  static std::string wanted() {
    if constexpr (std::is_same_v<T, std::string>)
      return "text";
    else if constexpr (std::is_integral_v<T>)
      return "a whole number";
    else
      return "a number";
  }

  static std::string describe(const YAML::Node& node) {
    if (node.IsScalar()) return "'" + node.Scalar() + "'";
    if (node.IsSequence()) return fmt::format("a list of {}", node.size());
    return node.IsMap() ? "a mapping" : "nothing";
  }

  template <class T>
  T convert(const YAML::Node& node, const std::string& field) const {
    try {
      return node.as<T>();
    } catch (const YAML::Exception&) {
      fail(node, field, fmt::format("got {}, wanted {}", describe(node), wanted<T>()));
    }
  }

  [[noreturn]] void fail(const YAML::Node& node, const std::string& field, const std::string& problem) const {
    throw Malformed{fmt::format("{}:{}: {}: {}", origin_, node.Mark().line + 1, field, problem)};
  }

  YAML::Node take(const char* key) {
    known_.insert(key);
    return node_[key] ? node_[key] : YAML::Node(YAML::NodeType::Undefined);
  }

  std::string name(const char* key) const { return path_.empty() ? key : path_ + "." + key; }

  YAML::Node node_;
  std::string path_;
  const std::string& origin_;
  std::set<std::string> known_;
};

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
  try {
    return read<T>(YAML::Load(std::string(text)), origin, reader);
  } catch (const YAML::Exception& error) {
    return not_yaml(error, origin);
  }
}

}  // namespace jostle::yaml
