#pragma once
/// \file
/// Transitions (x_n, u_n, x_{n+1}) of Sec. 7.2.1.2, and the file they are kept in.

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::studies {

inline constexpr int kMaxSliders = 4;
inline constexpr int kPlanarSize = 2 * (2 + 3 * kMaxSliders);

/// What the transitions of a file have in common; equal in all parts of it.
struct DataOrigin {
  std::uint64_t seed = 1;
  double pusher_radius = 0.0145, pusher_height = 0.11;     ///< m
  double slider_radius = 0.05115, slider_height = 0.0245;  ///< m
  double slider_mass = 0.5;                                ///< kg
  double slider_friction = 0.2;
  double duration = 1.0;     ///< Delta_t, s
  double time_step = 0.001;  ///< the fine model's, s
  double max_speed = 0.1;    ///< along each axis, m/s

  bool operator==(const DataOrigin&) const = default;
};

/// One application of F. States are PlanarLayout's of `sliders` sliders, the rest zero.
struct Transition {
  std::array<float, kPlanarSize> before{};
  std::array<float, 2> control{};  ///< m/s
  std::array<float, kPlanarSize> after{};
  std::uint32_t sliders = 0;

  bool operator==(const Transition&) const = default;
};

/// A file of transitions: 16 bytes of magic and version, the origin, then records
/// without gaps, all little-endian. A last record that was cut off does not count.
struct TransitionFile {
  DataOrigin origin;
  std::vector<Transition> transitions;
};

/// Errors   kNotFound, kIo, kInvalidArgument; the message names the file and the remedy.
Result<TransitionFile> read_transitions(const std::filesystem::path& file);

/// A TransitionWriter adds to a file, whole episodes at a time.
class TransitionWriter {
 public:
  /// Makes the file, or goes on after its last complete group of `group` records.
  /// Error kInvalidArgument if it is of another origin; names the field.
  static Result<TransitionWriter> open(const std::filesystem::path& file, const DataOrigin& origin, int group);

  /// Returns the number of records in the file.
  std::uint64_t size() const { return size_; }

  Result<void> append(const std::vector<Transition>& transitions);

 private:
  TransitionWriter(std::filesystem::path file, std::ofstream out, std::uint64_t size)
      : file_(std::move(file)), out_(std::move(out)), size_(size) {}

  std::filesystem::path file_;
  std::ofstream out_;
  std::uint64_t size_;
};

}  // namespace jostle::studies
