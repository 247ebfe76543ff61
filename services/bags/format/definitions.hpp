#pragma once
/// \file
/// Definitions of message types as text, and messages decoded by them.

#include <cstddef>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::bags {

/// Returns the definition of a type ("geometry_msgs/msg/Pose") as ROS 2 tools want it: its .msg file and, behind
/// lines of `=`, those of the types that it is made of. Every message of idl/msg has one, with the
/// comments it has there, and so have the parts of its services and actions ("jostle_msgs/action/Manipulate_Goal");
/// nothing for other types.
std::optional<std::string> definition_of(const std::string& type);

/// Returns the definitions that a type had before fields were appended, newest first, for old bags of our recorder in
/// rosbag2's storage, which bring no definitions. Empty if none was appended since bags were first recorded.
std::vector<std::string> earlier_definitions_of(const std::string& type);

/// Returns the ROS 2 name of a type that is written in another way: pkg/Name or pkg::msg::dds_::Name_ for
/// pkg/msg/Name. Another text stays what it is.
std::string ros_type_name(const std::string& type);

/// Returns the ROS 2 name of a topic that is written in another way: rt/name or name for /name.
std::string ros_topic_name(const std::string& topic);

/// Returns all types that have a definition, sorted.
std::vector<std::string> known_types();

/// Makes definitions, by type, from IDL: modules of modules (msg, srv, action) of structs, as idl/msg has them. A
/// module `Name_Constants` of `const TYPE NAME = VALUE;` holds the constants of the struct `Name`, as ROS 2 writes
/// them. Error kInvalidArgument with file name and line.
Result<std::map<std::string, std::string>> definitions_of_idl(
    const std::vector<std::pair<std::string_view, std::string_view>>& files);

/// Decodes messages of one type, by its definition.
///
/// Threads  safe from any thread.
class Decoder {
 public:
  /// Error kInvalidArgument: malformed, or a part is missing; names type and line.
  static Result<Decoder> create(const std::string& type, const std::string& definition);
  Decoder(Decoder&&) noexcept;
  Decoder& operator=(Decoder&&) noexcept;
  ~Decoder();

  /// Decodes CDR with its four bytes (XCDR1, of either byte order) into an object with fields in their
  /// order. Characters of wide strings may have two bytes or four: middlewares differ. Numbers that are not finite stay
  /// what they are; dump() makes null of them. Error kInvalidArgument: other bytes than the type has; says field, got,
  /// wanted.
  Result<nlohmann::ordered_json> decode(std::span<const std::byte> cdr) const;

 private:
  struct Types;
  explicit Decoder(std::unique_ptr<Types> types);
  std::unique_ptr<Types> types_;
};

}  // namespace jostle::bags
