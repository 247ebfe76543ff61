#pragma once
/// \file
/// A decoder for every topic of a bag that can have one.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/definitions.hpp"
#include "services/bags/format/message_files.hpp"

namespace jostle::bags {

class Decoders {
 public:
  /// Makes decoders from the bag's own definitions; from `messages` where it brings none. A definition that is
  /// malformed is as good as none.
  explicit Decoders(const BagInfo& info, const MessageFiles& messages = MessageFiles());

  bool has(int topic) const { return decoders_.at(static_cast<std::size_t>(topic)).has_value(); }
  /// Why a topic has none.
  const std::string& reason(int topic) const { return reasons_.at(static_cast<std::size_t>(topic)); }
  /// Error as Decoder's, with the topic in front.
  Result<nlohmann::ordered_json> decode(const Message& message) const;

 private:
  std::vector<std::string> names_, reasons_;
  std::vector<std::optional<Decoder>> decoders_;
  std::vector<std::vector<Decoder>> earlier_;  // for bags from before fields were appended
};

}  // namespace jostle::bags
