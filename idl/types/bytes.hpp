#pragma once
/// \file
/// Numbers in the bytes of a device's protocol, in either byte order.

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace jostle {

using Bytes = std::vector<std::uint8_t>;

/// A number or truth value that protocols carry.
template <class T>
concept WireNumber = std::is_arithmetic_v<T> &&(sizeof(T) == 1 || sizeof(T) == 2 || sizeof(T) == 4 || sizeof(T) == 8);

/// Appends numbers to bytes.
template <std::endian kOrder>
class ByteWriter {
 public:
  template <WireNumber T>
  ByteWriter& put(T value) {
    std::array<std::uint8_t, sizeof(T)> raw;
    std::memcpy(raw.data(), &value, sizeof value);
    if constexpr (kOrder != std::endian::native) std::ranges::reverse(raw);
    for (const std::uint8_t byte : raw) bytes_.push_back(byte);
    return *this;
  }
  template <WireNumber T, std::size_t N>
  ByteWriter& put(const std::array<T, N>& values) {
    for (const T value : values) put(value);
    return *this;
  }
  ByteWriter& put(std::span<const std::uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  /// Appends the characters alone, neither a length nor an end.
  ByteWriter& put(std::string_view text) {
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return *this;
  }

  const Bytes& bytes() const { return bytes_; }
  Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

/// Reads numbers one after the other. What is not there reads as 0, and ok() is false from then on, so that a
/// message is read to its end and judged once.
template <std::endian kOrder>
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : left_(bytes) {}

  template <WireNumber T>
  T get() {
    T value{};
    if (!has(sizeof(T))) return value;
    if constexpr (std::is_same_v<T, bool>) {
      value = left_.front() != 0;
    } else {
      std::array<std::uint8_t, sizeof(T)> raw;
      for (std::size_t i = 0; i < sizeof(T); ++i) {
        raw[kOrder == std::endian::native ? i : sizeof(T) - 1 - i] = left_[i];
      }
      std::memcpy(&value, raw.data(), sizeof value);
    }
    left_ = left_.subspan(sizeof(T));
    return value;
  }
  template <WireNumber T, std::size_t N>
  std::array<T, N> get_array() {
    std::array<T, N> values;
    for (T& value : values) value = get<T>();
    return values;
  }
  std::string get_text(std::size_t size) {
    if (!has(size)) return {};
    std::string text(left_.begin(), left_.begin() + static_cast<std::ptrdiff_t>(size));
    left_ = left_.subspan(size);
    return text;
  }
  void skip(std::size_t size) {
    if (has(size)) left_ = left_.subspan(size);
  }
  /// Returns a reader of the next `size` bytes alone, and goes on behind them.
  ByteReader part(std::size_t size) {
    if (!has(size)) return ByteReader({});
    ByteReader reader(left_.first(size));
    left_ = left_.subspan(size);
    return reader;
  }
  /// Reads everything that is left as text.
  std::string get_rest() { return get_text(left_.size()); }

  std::size_t left() const { return left_.size(); }
  bool ok() const { return ok_; }
  /// Whether everything that was asked for was there, and nothing is left.
  bool done() const { return ok_ && left_.empty(); }

 private:
  bool has(std::size_t size) {
    ok_ = ok_ && left_.size() >= size;
    return ok_;
  }

  std::span<const std::uint8_t> left_;
  bool ok_ = true;
};

using BigEndianWriter = ByteWriter<std::endian::big>;
using BigEndianReader = ByteReader<std::endian::big>;
using LittleEndianWriter = ByteWriter<std::endian::little>;
using LittleEndianReader = ByteReader<std::endian::little>;

}  // namespace jostle
