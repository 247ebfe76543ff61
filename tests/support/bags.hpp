#pragma once
/// \file
/// Bags for tests: messages that can be told apart, written and read back.

#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/bag_writer.hpp"

namespace jostle::tests {

using Bytes = std::vector<std::byte>;

/// CDR of a std_msgs/msg/String.
inline Bytes cdr_of(const std::string& text) {
  const auto length = static_cast<std::uint32_t>(text.size() + 1);
  Bytes bytes(4 + 4 + length);
  bytes[1] = std::byte{1};  // little-endian
  std::memcpy(bytes.data() + 4, &length, sizeof length);
  std::memcpy(bytes.data() + 8, text.c_str(), length);
  return bytes;
}

/// The reverse. On the wire up to three bytes of padding come behind it.
inline std::string text_of(const Bytes& cdr) {
  if (cdr.size() < 9) return "";
  const auto* text = reinterpret_cast<const char*>(cdr.data()) + 8;
  return {text, strnlen(text, cdr.size() - 8)};
}

/// That do not compress: the tail of a linear congruential generator, one per seed.
inline Bytes noise(std::size_t size, std::uint64_t seed) {
  Bytes bytes(size);
  std::uint64_t state = seed * 2654435761u + 1;
  for (std::byte& byte : bytes) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    byte = static_cast<std::byte>(state >> 56);
  }
  return bytes;
}

inline bags::Topic string_topic(const std::string& name, const Qos& qos = {}) {
  return {.name = name, .type = "std_msgs/msg/String", .qos = qos, .definition = "string data\n"};
}

template <class T>
T taken(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(result).value();
}
inline void taken(const Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message);
}

/// What is left to read. Throws what next() fails with.
inline std::vector<bags::Message> rest_of(bags::BagReader& reader) {
  std::vector<bags::Message> messages;
  while (auto message = taken(reader.next())) messages.push_back(std::move(*message));
  return messages;
}

inline std::vector<std::string> texts_of(const std::vector<bags::Message>& messages) {
  std::vector<std::string> texts;
  for (const bags::Message& message : messages) texts.push_back(text_of(message.data));
  return texts;
}

}  // namespace jostle::tests
