#pragma once
/// \file
/// The network's forward pass, in float32.

#include <span>

#include "physics_pool/coarse/learned/network.hpp"

namespace jostle::physics_pool {

/// Works out K answers at a time. An answer does not depend on how many are asked for with it,
/// nor on the machine: every sum runs over the inputs in their order.
///
/// Threads  one at a time. Nothing is allocated after construction.
class Forward {
 public:
  explicit Forward(const Network& network);

  /// `inputs` [K][kInputs] and `outputs` [K][kOutputs], row-major.
  void run(std::span<const float> inputs, std::span<float> outputs);

 private:
  static constexpr int kPanel = 8;    // rows of weights that lie together
  static constexpr int kColumns = 4;  // answers worked out side by side

  struct Layer {
    int inputs = 0, outputs = 0, panels = 0;
    bool is_last = false;
    std::vector<float> weights;  // [panels][inputs][kPanel]
    std::vector<float> biases;   // [panels][kPanel]
  };
  template <int kPanels, int kWide>
  static void multiply(const Layer& layer, int panel, const float* x, float* y);
  template <int kWide>
  static void run_layer(const Layer& layer, const float* x, float* y);
  template <int kWide>
  void run_columns(std::span<const float> inputs, std::span<float> outputs);

  std::vector<float> input_mean_, input_scale_, output_scale_;
  std::vector<Layer> layers_;
  std::vector<float> x_, y_;  // [neurons][kWide]
};

}  // namespace jostle::physics_pool
