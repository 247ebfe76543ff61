#include "physics_pool/coarse/learned/forward.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <utility>

namespace jostle::physics_pool {

Forward::Forward(const Network& network)
    : input_mean_(network.input_mean), input_scale_(network.input_scale), output_scale_(network.output_scale) {
  int widest = kInputs;
  for (const NetworkLayer& given : network.layers) {
    Layer layer{.inputs = given.inputs, .outputs = given.outputs, .panels = (given.outputs + kPanel - 1) / kPanel};
    layer.is_last = &given == &network.layers.back();
    layer.weights.assign(static_cast<std::size_t>(layer.panels * kPanel * layer.inputs), 0.0f);
    layer.biases.assign(static_cast<std::size_t>(layer.panels * kPanel), 0.0f);
    for (int row = 0; row < given.outputs; ++row) {
      const int panel = row / kPanel, lane = row % kPanel;
      layer.biases[static_cast<std::size_t>(row)] = given.biases[static_cast<std::size_t>(row)];
      for (int k = 0; k < given.inputs; ++k) {
        layer.weights[static_cast<std::size_t>((panel * layer.inputs + k) * kPanel + lane)] =
            given.weights[static_cast<std::size_t>(row * given.inputs + k)];
      }
    }
    widest = std::max(widest, layer.panels * kPanel);
    layers_.push_back(std::move(layer));
  }
  x_.resize(static_cast<std::size_t>(widest * kColumns));
  y_.resize(static_cast<std::size_t>(widest * kColumns));
}

// kPanels panels from `panel` on, for kWide answers: accumulators stay in registers.
template <int kPanels, int kWide>
void Forward::multiply(const Layer& layer, int panel, const float* x, float* y) {
  using Rows = Eigen::Array<float, kPanel, 1>;
  Rows sum[kPanels][kWide];
  for (int p = 0; p < kPanels; ++p) {
    const Eigen::Map<const Rows> bias(layer.biases.data() + (panel + p) * kPanel);
    for (int c = 0; c < kWide; ++c) sum[p][c] = bias;
  }
  const float* weights = layer.weights.data() + static_cast<std::ptrdiff_t>(panel) * layer.inputs * kPanel;
  for (int k = 0; k < layer.inputs; ++k) {
    for (int p = 0; p < kPanels; ++p) {
      const Rows w = Eigen::Map<const Rows>(weights + (static_cast<std::ptrdiff_t>(p) * layer.inputs + k) * kPanel);
      for (int c = 0; c < kWide; ++c) sum[p][c] += w * x[k * kWide + c];
    }
  }
  for (int p = 0; p < kPanels; ++p) {
    for (int row = 0; row < kPanel; ++row) {
      for (int c = 0; c < kWide; ++c) {
        const float value = sum[p][c][row];
        y[((panel + p) * kPanel + row) * kWide + c] = layer.is_last ? value : std::max(value, 0.0f);
      }
    }
  }
}

template <int kWide>
void Forward::run_layer(const Layer& layer, const float* x, float* y) {
  // One answer alone needs more rows at once to keep the adders busy.
  constexpr int kTogether = kWide == 1 ? 4 : 1;
  int panel = 0;
  for (; panel + kTogether <= layer.panels; panel += kTogether) multiply<kTogether, kWide>(layer, panel, x, y);
  for (; panel < layer.panels; ++panel) multiply<1, kWide>(layer, panel, x, y);
}

template <int kWide>
void Forward::run_columns(std::span<const float> inputs, std::span<float> outputs) {
  float* x = x_.data();
  float* y = y_.data();
  const int count = static_cast<int>(inputs.size()) / kInputs;  // at most kWide
  for (int k = 0; k < kInputs; ++k) {
    const auto i = static_cast<std::size_t>(k);
    for (int c = 0; c < kWide; ++c) {
      const float value = c < count ? inputs[static_cast<std::size_t>(c * kInputs + k)] : input_mean_[i];
      x[k * kWide + c] = (value - input_mean_[i]) / input_scale_[i];
    }
  }
  for (const Layer& layer : layers_) {
    run_layer<kWide>(layer, x, y);
    std::swap(x, y);
  }
  for (int c = 0; c < count; ++c) {
    for (int j = 0; j < kOutputs; ++j) {
      outputs[static_cast<std::size_t>(c * kOutputs + j)] =
          x[j * kWide + c] * output_scale_[static_cast<std::size_t>(j)];
    }
  }
}

void Forward::run(std::span<const float> inputs, std::span<float> outputs) {
  const std::size_t count = inputs.size() / kInputs;
  for (std::size_t done = 0; done < count;) {
    const std::size_t part = std::min<std::size_t>(count - done, kColumns);
    const auto in = inputs.subspan(done * kInputs, part * kInputs);
    const auto out = outputs.subspan(done * kOutputs, part * kOutputs);
    if (part == 1) {
      run_columns<1>(in, out);
    } else {
      run_columns<kColumns>(in, out);
    }
    done += part;
  }
}

}  // namespace jostle::physics_pool
