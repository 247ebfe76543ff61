#pragma once
/// \file
/// A trained network as data. The README of this folder documents the file.

#include <cstdint>
#include <filesystem>
#include <vector>

#include "idl/types/result.hpp"
#include "physics_pool/coarse/learned/push_view.hpp"

namespace jostle::physics_pool {

/// A layer computes y = W·x + b; all but the last then take max(y, 0).
struct NetworkLayer {
  int inputs = 0, outputs = 0;
  std::vector<float> weights;  ///< [outputs][inputs] row-major
  std::vector<float> biases;   ///< [outputs]
};

/// A network answers PushView::inputs with PushView::targets:
///
///   z_i = (input_i - input_mean_i) / input_scale_i,   output_j = y_j · output_scale_j
struct Network {
  PushBodies bodies;                           ///< those it was trained with
  double slider_height = 0.0;                  ///< m
  double slider_mass = 0.0;                    ///< kg
  double duration = 1.0;                       ///< Delta_t, s
  double longest_way = 0.0;                    ///< farthest that the pusher went in one step, m
  std::uint64_t samples = 0;                   ///< transitions it has seen
  Parking parking = kParking;                  ///< where unused sliders were put
  std::vector<float> input_mean, input_scale;  ///< [kInputs]
  std::vector<float> output_scale;             ///< [kOutputs]
  std::vector<NetworkLayer> layers;            ///< first takes kInputs, last gives kOutputs
};

/// Errors   kNotFound         the file is missing, or cannot be read
///          kInvalidArgument  it is no network file, of another version, cut off, too long, or
///                            a value is out of range; says file, field, got, wanted, remedy
Result<Network> load_network(const std::filesystem::path& file);

/// Reads the content of a file; `origin` names it in messages.
Result<Network> parse_network(std::string_view content, const std::string& origin);

/// Returns the content of a network's file; reading it back gives the same network bit for bit.
std::string to_file(const Network& network);

}  // namespace jostle::physics_pool
