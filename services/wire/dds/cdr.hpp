#pragma once
/// \file
/// Messages as bytes, for those who keep them: CDR with its four bytes of encapsulation.

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fmt/format.h>

#include <cstddef>
#include <span>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// Reads a T. Error kInvalidArgument: the bytes are none.
template <class T>
Result<T> from_cdr(std::span<const std::byte> data) {
  // The decoder only reads; its signature predates const.
  auto* bytes = const_cast<char*>(reinterpret_cast<const char*>(data.data()));
  try {
    eprosima::fastcdr::FastBuffer buffer(bytes, data.size());
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
    cdr.read_encapsulation();
    T message;
    message.deserialize(cdr);
    return message;
  } catch (const std::exception& error) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{} bytes are not the message they should be: {}", data.size(), error.what())};
  }
}

/// Reads a T as it is now, or as it was before fields were appended, of at most so many bytes with what aligns them:
/// the old layout with zeros behind it is the new one. `complete` gives the fields of an old one their values.
template <class T, class Complete>
Result<T> from_cdr_or_earlier(std::span<const std::byte> data, std::size_t appended, const Complete& complete) {
  auto result = from_cdr<T>(data);
  if (result) return result;
  std::vector<std::byte> longer(data.begin(), data.end());
  longer.resize(longer.size() + appended);
  auto earlier_result = from_cdr<T>(longer);
  if (!earlier_result) return result;
  complete(*earlier_result);
  return earlier_result;
}

template <class T>
std::vector<std::byte> to_cdr(const T& message) {
  eprosima::fastcdr::FastBuffer buffer;
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.serialize(cdr);
  const auto* bytes = reinterpret_cast<const std::byte*>(buffer.getBuffer());
  return {bytes, bytes + cdr.getSerializedDataLength()};
}

}  // namespace jostle::wire
