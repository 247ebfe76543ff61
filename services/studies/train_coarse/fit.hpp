#pragma once
/// \file
/// Fits the network to transitions, with libtorch.

#include <functional>
#include <stop_token>

#include "physics_pool/coarse/learned/network.hpp"
#include "services/studies/train_coarse/transitions.hpp"

namespace jostle::studies {

struct FitOptions {
  int epochs = 100;
  int batch_size = 1024;
  double learning_rate = 5e-4;         ///< at first; falls to nothing along half a cosine
  double no_penetration_weight = 2.0;  ///< W_F of Eq. 7.5
  double held_out = 0.05;              ///< share of the episodes that is for validation only
  std::uint64_t seed = 1;              ///< decides the first weights and the order of samples
  int threads = 2;
};

struct FitProgress {
  int epoch = 0;  ///< finished
  double loss = 0.0, held_out_loss = 0.0;
};

/// Whether this program was built with libtorch.
bool can_fit();

/// Fits the network of Sec. 7.2.1.1 (512, 256, 128 and 64 neurons, ReLU) and returns the one with the smallest
/// held-out loss of all epochs. Adam works on Eq. 7.5, mean over a batch:
///
///   W_F·sum_{i<j} min(|p_i - p_j| - (r_i + r_j), 0)^2 + W_F·sum_i min(|p_P - p_i| - (r_P + r_i), 0)^2
///   + |x^f - x^NN|^2
///
/// in the units of `output_scale`, over sliders that take part; penetration up to 0.5 mm,
/// which F has too, costs nothing. Transitions in which the pusher meets no slider teach nothing.
/// Errors   kUnavailable without libtorch; kInvalidArgument too few transitions;
///          kCancelled before the first epoch's end. Later the best so far is returned.
Result<physics_pool::Network> fit(const TransitionFile& data, const FitOptions& options, std::stop_token stop,
                                  const std::function<void(const FitProgress&)>& report = {});

/// Returns the largest difference between libtorch's forward pass and ours over the inputs of
/// these transitions, in SI. Error kUnavailable without libtorch.
Result<double> largest_difference(const physics_pool::Network& network, const TransitionFile& data);

}  // namespace jostle::studies
