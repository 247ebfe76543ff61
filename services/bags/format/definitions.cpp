// From IDL to .msg: the small part of IDL in which our messages are written.

#include "services/bags/format/definitions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <span>
#include <utility>
#include <vector>

namespace jostle::embedded {
extern const std::span<const std::pair<std::string_view, std::string_view>> kIdl;
}

namespace jostle::bags {
namespace {

struct Token {
  std::string text;     // empty at the end
  std::string comment;  // of a comment, without its slashes
  int line = 0;
  bool is_comment = false;
  bool begins_line = false;
};

struct Field {
  std::string type, array, name;  // "float64", "[<=3]", "x"
  std::string comment;            // on its line
  std::vector<std::string> comments_before;
  bool is_ours = false;  // its type is a message
};

struct Struct {
  std::vector<std::string> comments;
  std::vector<std::string> constants;  // lines, "uint8 OK=1  # comment"
  std::vector<Field> fields;
};

std::string line_of(const Field& field) {
  return fmt::format("{}{} {}{}{}\n", field.type, field.array, field.name, field.comment.empty() ? "" : "  # ",
                     field.comment);
}

using Structs = std::map<std::string, Struct>;  // by "pkg/Name", or "pkg/srv/Name", "pkg/action/Name"

std::vector<Token> tokens_of(std::string_view text) {
  std::vector<Token> tokens;
  int line = 1;
  bool begins_line = true;
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '\n') {
      ++line;
      begins_line = true;
      ++at;
      continue;
    }
    if (std::isspace(static_cast<unsigned char>(c)) != 0) {
      ++at;
      continue;
    }
    Token token{.line = line, .begins_line = std::exchange(begins_line, false)};
    const std::size_t end_of_line = std::min(text.find('\n', at), text.size());
    std::size_t end = at + 1;
    if (text.substr(at, 2) == "//") {
      token.is_comment = true;
      end = end_of_line;
      const std::size_t from = text.find_first_not_of(' ', at + 2);
      if (from < end) token.comment = text.substr(from, end - from);
    } else if (c == '#') {  // an include: all files are read anyway
      at = end_of_line;
      continue;
    } else if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') {
      while (end < text.size() &&
             (std::isalnum(static_cast<unsigned char>(text[end])) != 0 || text[end] == '_' || text[end] == ':')) {
        ++end;
      }
    }
    token.text = std::string(text.substr(at, end - at));
    if (token.is_comment) token.text = "//";
    tokens.push_back(std::move(token));
    at = end;
  }
  tokens.push_back({.line = line, .begins_line = true});
  return tokens;
}

const std::map<std::string, std::string>& basic_types() {
  static const std::map<std::string, std::string> kTypes{{"boolean", "bool"},
                                                         {"octet", "uint8"},
                                                         {"char", "char"},
                                                         {"uint8", "uint8"},
                                                         {"int8", "int8"},
                                                         {"short", "int16"},
                                                         {"unsigned short", "uint16"},
                                                         {"long", "int32"},
                                                         {"unsigned long", "uint32"},
                                                         {"long long", "int64"},
                                                         {"unsigned long long", "uint64"},
                                                         {"float", "float32"},
                                                         {"double", "float64"},
                                                         {"string", "string"}};
  return kTypes;
}

// Recursive descent over one file's tokens. The first thing that is wrong ends it.
class IdlParser {
 public:
  IdlParser(std::string_view file, std::string_view text, Structs& structs)
      : file_(file), tokens_(tokens_of(text)), structs_(structs) {}

  Result<void> parse() {
    while (!error_ && !peek().text.empty()) parse_package();
    if (error_) return *error_;
    return {};
  }

 private:
  const Token& peek() {
    while (tokens_[at_].is_comment) {
      if (tokens_[at_].begins_line) {
        // Only what stands directly in front of something speaks of it.
        if (!pending_.empty() && tokens_[at_].line > pending_line_ + 1) pending_.clear();
        pending_.push_back(tokens_[at_].comment);
        pending_line_ = tokens_[at_].line;
      }
      ++at_;
    }
    return tokens_[at_];
  }
  Token take() {
    Token token = peek();
    if (!token.text.empty()) ++at_;
    return token;
  }
  std::vector<std::string> comments_before(int line) {
    std::vector<std::string> comments = std::exchange(pending_, {});
    return pending_line_ + 1 == line ? comments : std::vector<std::string>();
  }
  std::string take_name() {
    const Token token = take();
    if (token.text.empty() || (std::isalpha(static_cast<unsigned char>(token.text[0])) == 0 && token.text[0] != '_')) {
      fail(token, "a name");
    }
    return token.text;
  }
  void expect(std::string_view text) {
    const Token token = take();
    if (token.text != text) fail(token, fmt::format("'{}'", text));
  }
  bool take_if(std::string_view text) {
    if (error_ || peek().text != text) return false;
    take();
    return true;
  }
  void fail(const Token& token, const std::string& wanted) {
    if (error_) return;
    error_ = Error{Code::kInvalidArgument,
                   fmt::format("{}: line {}: got '{}', wanted {}", file_, token.line, token.text, wanted)};
  }

  void parse_package() {
    expect("module");
    package_ = take_name();
    expect("{");
    do {
      parse_kind();
    } while (!error_ && !take_if("}"));
    expect(";");
  }

  // Parses the messages of a package, or the parts of its services, or of its actions.
  void parse_kind() {
    expect("module");
    const Token kind = take();
    if (kind.text != "msg" && kind.text != "srv" && kind.text != "action") fail(kind, "module msg, srv or action");
    prefix_ = prefix_of(package_, kind.text);
    expect("{");
    while (!error_ && !take_if("}")) {
      if (peek().text == "module") {
        parse_constants();
      } else {
        parse_struct();
      }
    }
    expect(";");
  }

  static std::string prefix_of(const std::string& package, const std::string& kind) {
    return package + (kind == "msg" ? "/" : "/" + kind + "/");
  }

  // Parses the constants of the struct that follows, in a module of their own: IDL has no constants in a struct.
  void parse_constants() {
    expect("module");
    const Token name = take();
    constexpr std::string_view kSuffix = "_Constants";
    if (!name.text.ends_with(kSuffix)) fail(name, "a struct, or a module of its constants, NAME_Constants");
    constants_of_ = name.text.substr(0, name.text.size() - std::min(kSuffix.size(), name.text.size()));
    expect("{");
    while (!error_ && !take_if("}")) {
      expect("const");
      Field constant;
      parse_type(constant);
      if (constant.is_ours) fail(peek(), "a constant of a basic type");
      constant.name = take_name();
      expect("=");
      constant.name += "=" + take().text;
      constant.comment = end_of_field();
      constants_.push_back(line_of(constant));
    }
    expect(";");
    pending_.clear();
  }

  void parse_struct() {
    const Token first = peek();
    Struct message{.comments = comments_before(first.line)};
    expect("struct");
    const std::string name = take_name();
    if (!constants_.empty() && name != constants_of_)
      fail(first, "struct " + constants_of_ + ", whose constants these are");
    message.constants = std::exchange(constants_, {});
    expect("{");
    while (!error_ && !take_if("}")) message.fields.push_back(parse_field());
    expect(";");
    pending_.clear();
    structs_[prefix_ + name] = std::move(message);
  }

  Field parse_field() {
    Field field;
    const int line = peek().line;
    field.comments_before = comments_before(line);
    while (take_if("@")) take_name();  // @key: DDS's, not the message's
    if (take_if("sequence")) {
      expect("<");
      parse_type(field);
      field.array = "[]";
      if (take_if(",")) field.array = "[<=" + take().text + "]";
      expect(">");
    } else {
      parse_type(field);
    }
    field.name = take_name();
    if (take_if("[")) {
      if (!field.array.empty()) fail(peek(), "an array of something else");
      field.array = "[" + take().text + "]";
      expect("]");
    }
    field.comment = end_of_field();
    return field;
  }

  // Its semicolon, and the comment on its line.
  std::string end_of_field() {
    const int last_line = tokens_[at_].line;
    expect(";");
    if (error_ || !tokens_[at_].is_comment || tokens_[at_].line != last_line) return "";
    return tokens_[at_++].comment;
  }

  void parse_type(Field& field) {
    const Token first = take();
    std::string name = first.text;
    if (name == "unsigned") name += " " + take().text;
    if ((name == "long" || name == "unsigned long") && take_if("long")) name += " long";
    if (const auto basic = basic_types().find(name); basic != basic_types().end()) {
      field.type = basic->second;
      if (name == "string" && take_if("<")) {
        field.type += "<=" + take().text;
        expect(">");
      }
      return;
    }
    // pkg::msg::Name, or a name of this module.
    field.is_ours = true;
    const std::size_t end_of_package = name.find("::");
    const std::size_t end_of_kind = name.find("::", end_of_package + 2);
    if (end_of_package != std::string::npos && end_of_kind != std::string::npos) {
      const std::string kind = name.substr(end_of_package + 2, end_of_kind - end_of_package - 2);
      field.type = prefix_of(name.substr(0, end_of_package), kind) + name.substr(end_of_kind + 2);
    } else if (end_of_package == std::string::npos && !name.empty() &&
               std::isalpha(static_cast<unsigned char>(name[0])) != 0) {
      field.type = prefix_ + name;
    } else {
      fail(first, "a type");
    }
  }

  std::string_view file_;
  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  Structs& structs_;
  std::string package_;
  std::string prefix_;                  // of names in Structs
  std::string constants_of_;            // a struct that must follow
  std::vector<std::string> constants_;  // its lines
  std::vector<std::string> pending_;    // comments on lines of their own
  int pending_line_ = 0;
  std::optional<Error> error_;
};

std::string text_of(const Struct& message) {
  std::string text;
  for (const std::string& comment : message.comments) text += "# " + comment + "\n";
  for (const std::string& constant : message.constants) text += constant;
  for (const Field& field : message.fields) {
    for (const std::string& comment : field.comments_before) text += "# " + comment + "\n";
    text += line_of(field);
  }
  return text;
}

// In the order in which they are met.
Result<void> collect_parts(const Structs& structs, const std::string& name, std::vector<std::string>& parts) {
  for (const Field& field : structs.at(name).fields) {
    if (!field.is_ours || std::ranges::find(parts, field.type) != parts.end()) continue;
    if (!structs.contains(field.type)) {
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: {}: got type {}, wanted one that the files have", name, field.name, field.type)};
    }
    parts.push_back(field.type);
    if (auto ok = collect_parts(structs, field.type, parts); !ok) return ok;
  }
  return {};
}

const std::map<std::string, std::string>& known() {
  // Our own files: a test makes sure that they are well-formed.
  static const std::map<std::string, std::string> kKnown = [] {
    auto result = definitions_of_idl({embedded::kIdl.begin(), embedded::kIdl.end()});
    return result ? std::move(*result) : std::map<std::string, std::string>();
  }();
  return kKnown;
}

}  // namespace

Result<std::map<std::string, std::string>> definitions_of_idl(
    const std::vector<std::pair<std::string_view, std::string_view>>& files) {
  Structs structs;
  for (const auto& [name, text] : files) {
    if (auto ok = IdlParser(name, text, structs).parse(); !ok) return ok.error();
  }
  std::map<std::string, std::string> definitions;
  const std::string line(80, '=');
  for (const auto& [name, message] : structs) {
    std::vector<std::string> parts;
    if (auto ok = collect_parts(structs, name, parts); !ok) return ok.error();
    std::string text = text_of(message);
    for (const std::string& part : parts) text += fmt::format("{}\nMSG: {}\n{}", line, part, text_of(structs.at(part)));
    const std::size_t slash = name.find('/');
    const bool is_message = name.find('/', slash + 1) == std::string::npos;
    definitions[is_message ? name.substr(0, slash) + "/msg" + name.substr(slash) : name] = std::move(text);
  }
  return definitions;
}

std::optional<std::string> definition_of(const std::string& type) {
  const auto found = known().find(type);
  if (found == known().end()) return {};
  return found->second;
}

std::vector<std::string> earlier_definitions_of(const std::string& type) {
  using Fields = std::vector<std::string>;
  static const std::map<std::string, std::vector<Fields>> kAppended{
      // at one time each, newest first
      {"jostle_msgs/msg/Feedback", {{"float64 idle"}}},
      {"jostle_msgs/msg/GoalResult", {{"uint8 ending"}}},
      {"jostle_msgs/msg/ObjectStates", {{"string scene"}}},
      {"jostle_msgs/msg/Observation", {{"float64 idle"}}},
      {"jostle_msgs/msg/Plan", {{"float64 deviation", "bool while_acting"}}},
      {"jostle_msgs/msg/RobotStatus", {{"string scene"}, {"uint8 error_code"}, {"float64[] limits"}}},
      {"jostle_msgs/msg/WorkerHeartbeat", {{"uint64 refused"}}}};
  std::vector<std::string> earlier;
  const auto appended = kAppended.find(type);
  std::optional<std::string> definition = definition_of(type);
  if (appended == kAppended.end() || !definition) return earlier;
  for (const Fields& fields : appended->second) {
    for (const std::string& field : fields) {
      const std::size_t line = definition->find(field);
      if (line == std::string::npos) return earlier;
      definition->erase(line, definition->find('\n', line) + 1 - line);
    }
    earlier.push_back(*definition);
  }
  return earlier;
}

std::vector<std::string> known_types() {
  std::vector<std::string> types;
  for (const auto& [type, text] : known()) types.push_back(type);
  return types;
}

}  // namespace jostle::bags
