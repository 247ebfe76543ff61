// From CDR to JSON, by a definition that a bag brings along.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <utility>
#include <vector>

#include "services/bags/format/definitions.hpp"

namespace jostle::bags {
namespace {

using Json = nlohmann::ordered_json;

enum class Basic { kBool, kU8, kI8, kU16, kI16, kU32, kI32, kU64, kI64, kF32, kF64, kString, kWideString, kMessage };

constexpr std::array<std::pair<std::string_view, Basic>, 15> kBasics{{{"bool", Basic::kBool},
                                                                      {"byte", Basic::kU8},
                                                                      {"char", Basic::kU8},
                                                                      {"uint8", Basic::kU8},
                                                                      {"int8", Basic::kI8},
                                                                      {"uint16", Basic::kU16},
                                                                      {"int16", Basic::kI16},
                                                                      {"uint32", Basic::kU32},
                                                                      {"int32", Basic::kI32},
                                                                      {"uint64", Basic::kU64},
                                                                      {"int64", Basic::kI64},
                                                                      {"float32", Basic::kF32},
                                                                      {"float64", Basic::kF64},
                                                                      {"string", Basic::kString},
                                                                      {"wstring", Basic::kWideString}}};

// The bytes that a value takes; for strings and messages, the least.
constexpr std::size_t size_of(Basic basic) {
  switch (basic) {
    case Basic::kU16:
    case Basic::kI16:
      return 2;
    case Basic::kU32:
    case Basic::kI32:
    case Basic::kF32:
      return 4;
    case Basic::kU64:
    case Basic::kI64:
    case Basic::kF64:
      return 8;
    default:
      return 1;
  }
}

struct Field {
  std::string name;
  Basic basic = Basic::kU8;
  std::size_t message = 0;  // index of the type, if it is one
  bool is_sequence = false;
  std::size_t count = 0;  // of an array; 0: a single value
};

struct MessageType {
  std::string name;  // pkg/Name
  std::vector<Field> fields;
};

// pkg/Name for a type's ROS 2 name; another name stays what it is.
std::string short_name(const std::string& type) {
  const std::string name = ros_type_name(type);
  const std::size_t at = name.find("/msg/");
  return at == std::string::npos ? name : name.substr(0, at) + name.substr(at + 4);
}

// Appends a character as UTF-8; what is none, such as half of a pair, as the sign for that.
void append_utf8(std::string& to, std::uint32_t character) {
  constexpr std::uint32_t kNone = 0xFFFD;
  if (character > 0x10FFFF || (character >= 0xD800 && character < 0xE000)) character = kNone;
  if (character < 0x80) {
    to += static_cast<char>(character);
    return;
  }
  const int more = character < 0x800 ? 1 : character < 0x10000 ? 2 : 3;  // bytes behind the first
  constexpr std::array<unsigned, 4> kFirst{0, 0xC0, 0xE0, 0xF0};
  to += static_cast<char>(kFirst.at(static_cast<std::size_t>(more)) | character >> (6 * more));
  for (int i = more - 1; i >= 0; --i) to += static_cast<char>(0x80 | (character >> (6 * i) & 0x3F));
}

// A line of a .msg file up to a comment. A '#' in a default value of text is part of it,
// yet what stands behind name and type is not needed.
std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line.substr(0, line.find('#')));
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

}  // namespace

struct Decoder::Types {
  std::vector<MessageType> types;  // the first is the whole
  bool has_wide_strings = false;

  Error malformed(const std::string& type, int line, const std::string& what) const {
    return {Code::kInvalidArgument, fmt::format("definition of {}: line {}: {}", type, line, what)};
  }

  Result<void> parse(const std::string& type, const std::string& definition) {
    // First the names of all parts, so that fields find theirs.
    struct Line {
      int number = 0;
      std::vector<std::string> words;
    };
    std::vector<std::vector<Line>> parts(1);
    types.push_back({.name = short_name(type)});
    std::istringstream in(definition);
    std::string text;
    for (int number = 1; std::getline(in, text); ++number) {
      if (text.starts_with("===")) continue;
      auto words = words_of(text);
      if (words.empty()) continue;
      if (words[0] == "MSG:" && words.size() == 2) {
        types.push_back({.name = short_name(words[1])});
        parts.emplace_back();
        continue;
      }
      parts.back().push_back({number, std::move(words)});
    }
    for (std::size_t part = 0; part < parts.size(); ++part) {
      for (const Line& line : parts[part]) {
        if (line.words.size() < 2) {
          return malformed(type, line.number, fmt::format("got '{}', wanted a type and a name", line.words[0]));
        }
        // NAME=value, NAME = value: constants are not on the wire.
        if (line.words[1].find('=') != std::string::npos || (line.words.size() > 2 && line.words[2].starts_with('='))) {
          continue;
        }
        auto field_result = parse_field(type, types[part].name, line.words[0], line.words[1], line.number);
        if (!field_result) return field_result.error();
        has_wide_strings = has_wide_strings || field_result->basic == Basic::kWideString;
        types[part].fields.push_back(std::move(*field_result));
      }
    }
    std::vector<int> depths(types.size(), 0);
    if (auto depth_result = depth_of(type, 0, 1, depths); !depth_result) return depth_result.error();
    return {};
  }

  Result<Field> parse_field(const std::string& whole, const std::string& owner, std::string type,
                            const std::string& name, int line) const {
    Field field{.name = name};
    if (const std::size_t open = type.find('['); open != std::string::npos) {
      if (type.back() != ']') {
        return malformed(whole, line, fmt::format("got type '{}', wanted an array that ends with ]", type));
      }
      const std::string inside = type.substr(open + 1, type.size() - open - 2);
      field.is_sequence = inside.empty() || inside.starts_with("<=");
      if (!field.is_sequence) {
        const auto [end, problem] = std::from_chars(inside.data(), inside.data() + inside.size(), field.count);
        if (problem != std::errc() || end != inside.data() + inside.size() || field.count == 0) {
          return malformed(whole, line, fmt::format("got array size '{}', wanted a number of 1 or more", inside));
        }
      }
      type.resize(open);
    }
    for (const char* text : {"string", "wstring"}) {
      if (type.starts_with(std::string(text) + "<=")) type = text;
    }
    for (const auto& [basic_name, basic] : kBasics) {
      if (type == basic_name) {
        field.basic = basic;
        return field;
      }
    }
    if (type == "time" || type == "duration") {
      type = type == "time" ? "builtin_interfaces/Time" : "builtin_interfaces/Duration";
    }
    if (type == "Header") type = "std_msgs/Header";
    type = short_name(type);
    if (type.find('/') == std::string::npos) type = owner.substr(0, owner.find('/') + 1) + type;
    const auto part = std::ranges::find(types, type, &MessageType::name);
    if (part == types.end()) {
      return malformed(whole, line,
                       fmt::format("got type {}, wanted a basic one or one that the definition has", type));
    }
    field.basic = Basic::kMessage;
    field.message = static_cast<std::size_t>(part - types.begin());
    return field;
  }

  // How many types deep a type nests, known ones in `depths`. One that contains itself would have
  // no end, and decoding calls itself for each.
  Result<int> depth_of(const std::string& whole, std::size_t type, int level, std::vector<int>& depths) const {
    constexpr int kDeepest = 100, kUnknown = 0, kUnderWay = -1;
    if (level > kDeepest) {
      return malformed(whole, 1, fmt::format("got types nested {} deep, wanted at most {}", level, kDeepest));
    }
    depths[type] = kUnderWay;
    int depth = 0;
    for (const Field& field : types[type].fields) {
      if (field.basic != Basic::kMessage) continue;
      int& known = depths[field.message];
      if (known == kUnderWay) return malformed(whole, 1, fmt::format("{} contains itself", types[field.message].name));
      if (known == kUnknown) {
        if (auto depth_result = depth_of(whole, field.message, level + 1, depths); !depth_result) return depth_result;
      }
      depth = std::max(depth, known);
    }
    if (level + depth > kDeepest) {
      return malformed(whole, 1, fmt::format("got types nested {} deep, wanted at most {}", level + depth, kDeepest));
    }
    return depths[type] = depth + 1;
  }
};

namespace {

// Takes values off CDR. The first thing that is missing ends it; everything after it is empty.
class CdrReader {
 public:
  // `wide`: bytes of a character of a wide string.
  CdrReader(std::span<const std::byte> data, bool swaps, const std::vector<MessageType>& types, std::size_t wide)
      : data_(data), swaps_(swaps), types_(types), wide_(wide) {}

  Json message(std::size_t type) {
    Json object = Json::object();
    const auto& fields = types_[type].fields;
    if (fields.empty()) take(std::min<std::size_t>(1, left()));  // rosidl gives empty messages a byte, others none
    for (const Field& field : fields) {
      if (!problem_.empty()) break;
      const std::size_t path_size = path_.size();
      path_ += (path_.empty() ? "" : ".") + field.name;
      object[field.name] = field.is_sequence ? many(field, sequence_length(field))
                           : field.count > 0 ? many(field, field.count)
                                             : value(field);
      path_.resize(path_size);
    }
    return object;
  }

  const std::string& problem() const { return problem_; }
  std::size_t left() const { return data_.size() - at_; }

 private:
  void fail(const std::string& what) {
    if (problem_.empty()) problem_ = fmt::format("{}: byte {}: {}", path_, at_ + 4, what);
  }
  std::span<const std::byte> take(std::size_t count) {
    if (!problem_.empty() || count > left()) {
      fail(fmt::format("got {} bytes, wanted {}", left(), count));
      at_ = data_.size();
      return {};
    }
    at_ += count;
    return data_.subspan(at_ - count, count);
  }
  template <class T>
  T number() {
    const std::size_t past = at_ % sizeof(T);
    if (past != 0) take(std::min(sizeof(T) - past, left()));
    std::array<std::byte, sizeof(T)> bytes{};
    if (const auto taken = take(sizeof(T)); taken.size() == sizeof(T)) std::ranges::copy(taken, bytes.begin());
    if (swaps_) std::ranges::reverse(bytes);
    return std::bit_cast<T>(bytes);
  }
  std::size_t sequence_length(const Field& field) {
    const auto count = number<std::uint32_t>();
    if (count > left() / size_of(field.basic)) {
      fail(fmt::format("got a length of {}, wanted at most {}, for which there are bytes", count,
                       left() / size_of(field.basic)));
      return 0;
    }
    return count;
  }
  Json many(const Field& field, std::size_t count) {
    Json list = Json::array();
    for (std::size_t i = 0; i < count && problem_.empty(); ++i) list.push_back(value(field));
    return list;
  }
  Json value(const Field& field) {
    switch (field.basic) {
      case Basic::kBool:
        return number<std::uint8_t>() != 0;
      case Basic::kU8:
        return number<std::uint8_t>();
      case Basic::kI8:
        return number<std::int8_t>();
      case Basic::kU16:
        return number<std::uint16_t>();
      case Basic::kI16:
        return number<std::int16_t>();
      case Basic::kU32:
        return number<std::uint32_t>();
      case Basic::kI32:
        return number<std::int32_t>();
      case Basic::kU64:
        return number<std::uint64_t>();
      case Basic::kI64:
        return number<std::int64_t>();
      case Basic::kF32:
        return number<float>();
      case Basic::kF64:
        return number<double>();
      case Basic::kString:
        return text();
      case Basic::kWideString:
        return wide_text();
      case Basic::kMessage:
        return message(field.message);
    }
    return {};
  }
  std::string wide_text() {
    const auto count = number<std::uint32_t>();
    if (count > left() / wide_) {
      fail(fmt::format("got a length of {}, wanted at most {}, for which there are bytes", count, left() / wide_));
      return {};
    }
    std::string text;
    std::uint32_t high = 0;  // first half of a pair
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t unit = wide_ == 2 ? number<std::uint16_t>() : number<std::uint32_t>();
      if (unit > 0x10FFFF) fail(fmt::format("got character {:#x}, wanted one of Unicode", unit));
      const bool ends_pair = high != 0 && unit >= 0xDC00 && unit < 0xE000;
      if (high != 0 && !ends_pair) append_utf8(text, high);
      if (ends_pair) {
        append_utf8(text, 0x10000 + ((high - 0xD800) << 10) + (unit - 0xDC00));
      } else if (unit < 0xD800 || unit >= 0xDC00) {
        append_utf8(text, unit);
      }
      high = unit >= 0xD800 && unit < 0xDC00 ? unit : 0;
    }
    if (high != 0) append_utf8(text, high);
    if (!text.empty() && text.back() == '\0') text.pop_back();  // with a zero at the end, as some write it
    return text;
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    const auto bytes = take(size);
    // With its zero at the end, as a rule.
    std::size_t length = bytes.size();
    if (length > 0 && bytes[length - 1] == std::byte{0}) --length;
    return {reinterpret_cast<const char*>(bytes.data()), length};
  }

  std::span<const std::byte> data_;
  std::size_t at_ = 0;
  const bool swaps_;
  const std::vector<MessageType>& types_;
  const std::size_t wide_;
  std::string path_, problem_;
};

}  // namespace

Decoder::Decoder(std::unique_ptr<Types> types) : types_(std::move(types)) {}
Decoder::Decoder(Decoder&&) noexcept = default;
Decoder& Decoder::operator=(Decoder&&) noexcept = default;
Decoder::~Decoder() = default;

Result<Decoder> Decoder::create(const std::string& type, const std::string& definition) {
  auto types = std::make_unique<Types>();
  if (auto ok = types->parse(type, definition); !ok) return ok.error();
  return Decoder(std::move(types));
}

Result<Json> Decoder::decode(std::span<const std::byte> cdr) const {
  const std::string& name = types_->types.front().name;
  if (cdr.size() < 4) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got {} bytes, wanted 4 or more", name, cdr.size())};
  }
  const auto kind = static_cast<unsigned>(cdr[0]) << 8 | static_cast<unsigned>(cdr[1]);
  if (kind > 1) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: byte 0: got encapsulation {:04x}, wanted 0000 or 0001 (plain CDR)", name, kind)};
  }
  const bool is_little = kind == 1;
  const bool swaps = is_little != (std::endian::native == std::endian::little);
  const auto decode_with = [&](std::size_t wide, std::size_t most_left) -> Result<Json> {
    CdrReader reader(cdr.subspan(4), swaps, types_->types, wide);
    Json object = reader.message(0);
    if (!reader.problem().empty()) return Error{Code::kInvalidArgument, fmt::format("{}: {}", name, reader.problem())};
    if (reader.left() > most_left) {
      return Error{Code::kInvalidArgument, fmt::format("{}: got {} bytes more than the type has", name, reader.left())};
    }
    return object;
  };
  // Writers may fill up to a multiple of their alignment: with characters of a wrong width more would be left.
  constexpr std::size_t kFill = 7, kLeastFill = 3;
  if (types_->has_wide_strings) {
    for (const std::size_t wide : {2, 4}) {
      if (auto object_result = decode_with(wide, kLeastFill)) return object_result;
    }
  }
  return decode_with(2, kFill);
}

std::string ros_type_name(const std::string& type) {
  static const std::regex on_the_wire(R"((\w+)::msg::dds_::(\w+)_)"), in_short(R"((\w+)/(\w+))");
  std::smatch match;
  if (std::regex_match(type, match, on_the_wire) || std::regex_match(type, match, in_short)) {
    return match.str(1) + "/msg/" + match.str(2);
  }
  return type;
}

std::string ros_topic_name(const std::string& topic) {
  if (topic.starts_with("rt/")) return topic.substr(2);
  return topic.starts_with('/') || topic.empty() ? topic : fmt::format("/{}", topic);
}

}  // namespace jostle::bags
