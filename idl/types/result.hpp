#pragma once
/// \file
/// Failure as a value: what crosses a room's border instead of an exception.

#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace jostle {

/// What kind of failure, for code that has to react. People read the message.
enum class Code {
  kInvalidArgument,  ///< a field has a wrong size, range or name
  kNotFound,         ///< a file, an object or a robot of that name does not exist, or cannot be read
  kUnknownWorld,     ///< no world with that hash was loaded
  kDeadline,         ///< time ran out before the work was done
  kCancelled,        ///< somebody asked to stop
  kUnavailable,      ///< the other side is gone or silent
  kIo,               ///< a file or a socket refused
  kInternal,         ///< our own bug
};

/// Says what, where, got, wanted, and the remedy if there is one.
struct Error {
  Code code = Code::kInternal;
  std::string message;
};

/// Makes the Error of a field that is not as it should be: "FIELD: got GOT, wanted WANTED".
inline Error invalid(const std::string& field, const std::string& got, const std::string& wanted) {
  return {Code::kInvalidArgument, field + ": got " + got + ", wanted " + wanted};
}

/// A Result holds either a T or an Error; shaped like std::expected so that it can become it.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : content_(std::move(value)) {}
  Result(Error error) : content_(std::move(error)) {}

  explicit operator bool() const { return has_value(); }
  bool has_value() const { return content_.index() == 0; }

  T& value() & { return std::get<0>(content_); }
  const T& value() const& { return std::get<0>(content_); }
  T&& value() && { return std::get<0>(std::move(content_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  const Error& error() const { return std::get<1>(content_); }

 private:
  std::variant<T, Error> content_;
};

/// Success without a value.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}

  explicit operator bool() const { return has_value(); }
  bool has_value() const { return !error_; }
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

}  // namespace jostle
