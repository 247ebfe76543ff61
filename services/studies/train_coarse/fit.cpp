#include "services/studies/train_coarse/fit.hpp"

#include <fmt/format.h>
#include <torch/torch.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "physics_pool/coarse/learned/forward.hpp"
#include "services/studies/train_coarse/examples.hpp"

namespace jostle::studies {
namespace {

using physics_pool::kInputs;
using physics_pool::kOutputs;
using physics_pool::kSlotOutputs;
using physics_pool::kSlots;
using physics_pool::Network;
using physics_pool::NetworkLayer;

constexpr std::array kWidths{kInputs, 512, 256, 128, 64, kOutputs};  // Sec. 7.2.1.1
constexpr float kPositionUnit = 0.01f;                               // m; what an error of one unit is
constexpr float kAngleUnit = 0.4f;                                   // rad; cylinders look the same from all sides
constexpr float kVelocityUnit = 2.0f;  // shares of the pusher's speed; forgotten within millimetres
constexpr float kTolerance = 5e-4f;    // m, of penetration
constexpr std::size_t kFewest = 200;   // transitions that touch something
constexpr long kChunk = 8192;          // held-out examples judged at a time

struct Mlp : torch::nn::Module {
  Mlp() {
    for (std::size_t i = 0; i + 1 < kWidths.size(); ++i) {
      layers.push_back(register_module(fmt::format("layer{}", i + 1), torch::nn::Linear(kWidths[i], kWidths[i + 1])));
    }
  }

  torch::Tensor forward(torch::Tensor x) {
    for (std::size_t i = 0; i + 1 < layers.size(); ++i) x = torch::relu(layers[i]->forward(x));
    return layers.back()->forward(x);
  }

  std::vector<torch::nn::Linear> layers;
};

torch::Tensor tensor_of(const std::vector<float>& values, int width) {
  return torch::from_blob(const_cast<float*>(values.data()), {static_cast<long>(values.size()) / width, width}).clone();
}

std::vector<float> values_of(const torch::Tensor& tensor) {
  const torch::Tensor flat = tensor.detach().contiguous();
  return {flat.data_ptr<float>(), flat.data_ptr<float>() + flat.numel()};
}

// Examples in the network's units.
struct Tensors {
  torch::Tensor inputs, targets, places;

  Tensors at(const torch::Tensor& rows) const {
    return {inputs.index_select(0, rows), targets.index_select(0, rows), places.index_select(0, rows)};
  }
};

struct Geometry {
  float pusher_reach, slider_reach;  // m, less the tolerance
};

// Eq. 7.5, mean over the rows. Unused slots are parked: they penetrate nothing, and
// their targets are zero.
torch::Tensor loss(const torch::Tensor& answers, const Tensors& batch, const Geometry& geometry, double weight) {
  torch::Tensor total = (answers - batch.targets).square().sum(1);
  if (weight > 0) {
    const torch::Tensor change = answers.view({-1, kSlots, kSlotOutputs}).narrow(2, 0, 2) * kPositionUnit;
    const torch::Tensor guess = batch.places.narrow(1, 0, 2 * kSlots).view({-1, kSlots, 2});
    const torch::Tensor after = guess + change;
    const torch::Tensor pusher = batch.places.narrow(1, 2 * kSlots, 2).unsqueeze(1);
    const auto depth = [](const torch::Tensor& apart, float reach) {
      return ((apart.square().sum(-1) + 1e-12).sqrt() - reach).clamp_max(0) / kPositionUnit;
    };
    torch::Tensor penetration = depth(after - pusher, geometry.pusher_reach).square().sum(1);
    for (int i = 0; i < kSlots; ++i) {
      for (int j = i + 1; j < kSlots; ++j) {
        penetration = penetration + depth(after.select(1, i) - after.select(1, j), geometry.slider_reach).square();
      }
    }
    total = total + weight * penetration;
  }
  return total.mean();
}

Network network_of(const Mlp& mlp, const Network& frame) {
  Network network = frame;
  network.layers.clear();
  for (const torch::nn::Linear& linear : mlp.layers) {
    NetworkLayer layer{.inputs = static_cast<int>(linear->weight.size(1)),
                       .outputs = static_cast<int>(linear->weight.size(0))};
    layer.weights = values_of(linear->weight);
    layer.biases = values_of(linear->bias);
    network.layers.push_back(std::move(layer));
  }
  return network;
}

// Everything but the layers.
Network frame_of(const TransitionFile& data, const Examples& examples) {
  Network network;
  network.bodies = bodies_of(data.origin);
  network.slider_height = data.origin.slider_height;
  network.slider_mass = data.origin.slider_mass;
  network.duration = data.origin.duration;
  network.longest_way = data.origin.max_speed * data.origin.duration * std::numbers::sqrt2;
  network.samples = data.transitions.size();
  const torch::Tensor inputs = tensor_of(examples.inputs, kInputs);
  network.input_mean = values_of(inputs.mean(0));
  // An input that is always the same says nothing; and nothing is divided by zero.
  network.input_scale = values_of(inputs.std(0, false).clamp_min(1e-3));
  for (int slot = 0; slot < kSlots; ++slot) {
    const float units[kSlotOutputs] = {kPositionUnit, kPositionUnit, kAngleUnit,
                                       kVelocityUnit, kVelocityUnit, kVelocityUnit};
    network.output_scale.insert(network.output_scale.end(), std::begin(units), std::end(units));
  }
  return network;
}

Tensors tensors_of(const Examples& examples, const Network& frame) {
  return {(tensor_of(examples.inputs, kInputs) - tensor_of(frame.input_mean, kInputs)) /
              tensor_of(frame.input_scale, kInputs),
          tensor_of(examples.targets, kOutputs) / tensor_of(frame.output_scale, kOutputs),
          tensor_of(examples.places, Examples::kPlaces)};
}

double held_out_loss(Mlp& mlp, const Tensors& held_out, const Geometry& geometry, double weight) {
  const torch::NoGradGuard no_gradients;
  const long size = held_out.inputs.size(0);
  double sum = 0.0;
  for (long first = 0; first < size; first += kChunk) {
    const long count = std::min(kChunk, size - first);
    const Tensors part = held_out.at(torch::arange(first, first + count));
    sum += static_cast<double>(count) * loss(mlp.forward(part.inputs), part, geometry, weight).item<double>();
  }
  return sum / static_cast<double>(size);
}

Result<Network> fit_with_torch(const TransitionFile& data, const FitOptions& options, std::stop_token stop,
                               const std::function<void(const FitProgress&)>& report) {
  const Examples learn = examples_of(data, Part::kLearn, options.held_out, physics_pool::kParking);
  const Examples check = examples_of(data, Part::kHeldOut, options.held_out, physics_pool::kParking);
  if (learn.size() < kFewest || check.size() == 0) {
    return Error{
        Code::kInvalidArgument,
        fmt::format(
            "got {} transitions that touch a slider to learn from and {} to check, wanted {} and 1; collect more",
            learn.size(), check.size(), kFewest)};
  }
  torch::set_num_threads(options.threads);
  torch::manual_seed(options.seed);
  const Network frame = frame_of(data, learn);
  const Tensors learned = tensors_of(learn, frame), held_out = tensors_of(check, frame);
  const Geometry geometry{static_cast<float>(frame.bodies.pusher_reach()) - kTolerance,
                          static_cast<float>(frame.bodies.slider_reach()) - kTolerance};
  const double weight = options.no_penetration_weight;
  Mlp mlp;
  torch::optim::Adam adam(mlp.parameters(), torch::optim::AdamOptions(options.learning_rate));
  const long size = learned.inputs.size(0), batch_size = std::min<long>(options.batch_size, size);
  const long batches = size / batch_size, steps = batches * options.epochs;

  std::optional<Network> best;
  double best_loss = std::numeric_limits<double>::infinity();
  long step = 0;
  for (int epoch = 1; epoch <= options.epochs; ++epoch) {
    const torch::Tensor order = torch::randperm(size);
    double sum = 0.0;
    for (long i = 0; i < batches; ++i, ++step) {
      if (stop.stop_requested()) {
        if (best) return *best;
        return Error{Code::kCancelled, "interrupted"};
      }
      const double progress = static_cast<double>(step) / static_cast<double>(steps);
      const double rate = options.learning_rate * 0.5 * (1 + std::cos(std::numbers::pi * progress));
      static_cast<torch::optim::AdamOptions&>(adam.param_groups().front().options()).lr(rate);
      const Tensors batch = learned.at(order.narrow(0, i * batch_size, batch_size));
      const torch::Tensor value = loss(mlp.forward(batch.inputs), batch, geometry, weight);
      adam.zero_grad();
      value.backward();
      adam.step();
      sum += value.item<double>();
    }
    const FitProgress progress{epoch, sum / static_cast<double>(batches),
                               held_out_loss(mlp, held_out, geometry, weight)};
    if (progress.held_out_loss < best_loss) {
      best_loss = progress.held_out_loss;
      best = network_of(mlp, frame);
    }
    if (report) report(progress);
  }
  if (!best) return Error{Code::kInternal, "the loss became infinite; a smaller learning rate may help"};
  return *best;
}

double difference_with_torch(const Network& network, const TransitionFile& data) {
  const torch::NoGradGuard no_gradients;
  const Examples examples = examples_of(data, Part::kAll, 0.5, network.parking);
  std::vector<float> ours(examples.size() * kOutputs);
  physics_pool::Forward(network).run(examples.inputs, ours);
  torch::Tensor x = (tensor_of(examples.inputs, kInputs) - tensor_of(network.input_mean, kInputs)) /
                    tensor_of(network.input_scale, kInputs);
  for (const NetworkLayer& layer : network.layers) {
    x = torch::nn::functional::linear(x, tensor_of(layer.weights, layer.inputs),
                                      tensor_of(layer.biases, layer.outputs).squeeze(0));
    if (&layer != &network.layers.back()) x = torch::relu(x);
  }
  x = x * tensor_of(network.output_scale, kOutputs);
  return examples.size() > 0 ? (x - tensor_of(ours, kOutputs)).abs().max().item<double>() : 0.0;
}

}  // namespace

bool can_fit() { return true; }

// libtorch throws; nobody else has to know.
Result<Network> fit(const TransitionFile& data, const FitOptions& options, std::stop_token stop,
                    const std::function<void(const FitProgress&)>& report) {
  try {
    return fit_with_torch(data, options, std::move(stop), report);
  } catch (const c10::Error& error) {
    return Error{Code::kInternal, fmt::format("libtorch: {}", error.what_without_backtrace())};
  }
}

Result<double> largest_difference(const Network& network, const TransitionFile& data) {
  try {
    return difference_with_torch(network, data);
  } catch (const c10::Error& error) {
    return Error{Code::kInternal, fmt::format("libtorch: {}", error.what_without_backtrace())};
  }
}

}  // namespace jostle::studies
