#include "physics_pool/coarse/learned/network.hpp"

#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <functional>
#include <iterator>
#include <optional>
#include <string_view>

#include "idl/files/files.hpp"

namespace jostle::physics_pool {
namespace {

static_assert(std::endian::native == std::endian::little, "files are little-endian");

constexpr std::string_view kMagic = "jostle-network";
constexpr int kVersion = 1;
constexpr std::size_t kMaxBytes = 16u << 20;  // far above any network of this kind
constexpr double kMaxWidth = 4096;            // neurons of a layer
constexpr double kMaxLayers = 16;
constexpr std::string_view kRemedy = "write it anew with jostle train-coarse fit";

// Reads "key value value …" lines one after the other, then bytes.
class Parser {
 public:
  Parser(std::string_view content, std::string origin) : rest_(content), origin_(std::move(origin)) {}

  Error wrong(std::string_view field, const std::string& why) const {
    return {Code::kInvalidArgument, fmt::format("{}: {}: {}; {}", origin_, field, why, kRemedy)};
  }

  std::optional<Error> first_line() {
    const std::string_view line = take_line();
    if (!line.starts_with(kMagic) || line.size() < kMagic.size() + 2) {
      return wrong("magic", fmt::format("wanted a first line '{} {}'", kMagic, kVersion));
    }
    const std::string_view version = line.substr(kMagic.size() + 1);
    if (version != std::to_string(kVersion)) {
      return wrong("version", fmt::format("got '{}', wanted {}", version.substr(0, 20), kVersion));
    }
    return {};
  }

  // `count` numbers in [low, high]; any count if it is 0.
  std::optional<Error> numbers(std::string_view key, std::size_t count, double low, double high,
                               std::vector<double>& values) {
    std::string_view line = take_line();
    if (line.substr(0, line.find(' ')) != key) {
      return wrong(key, fmt::format("got a line '{}', wanted '{} …'", line.substr(0, 30), key));
    }
    line.remove_prefix(key.size());
    values.clear();
    while (!line.empty()) {
      double value = 0.0;
      line.remove_prefix(1);
      const auto [end, problem] = std::from_chars(line.data(), line.data() + line.size(), value);
      const bool ends = end == line.data() + line.size() || *end == ' ';
      if (problem != std::errc{} || !ends || !(value >= low && value <= high)) {
        return wrong(key,
                     fmt::format("got '{}', wanted a number in [{}, {}]", line.substr(0, line.find(' ')), low, high));
      }
      values.push_back(value);
      line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    }
    if (count > 0 && values.size() != count) {
      return wrong(key, fmt::format("got {} values, wanted {}", values.size(), count));
    }
    return {};
  }

  std::optional<Error> number(std::string_view key, double low, double high, double& value) {
    std::vector<double> values;
    if (auto error = numbers(key, 1, low, high, values)) return error;
    value = values.front();
    return {};
  }

  std::optional<Error> floats(std::string_view key, std::size_t count, double low, double high,
                              std::vector<float>& values) {
    std::vector<double> exact;
    if (auto error = numbers(key, count, low, high, exact)) return error;
    values.assign(exact.begin(), exact.end());
    return {};
  }

  std::optional<Error> binary(std::string_view what, std::size_t count, std::vector<float>& values) {
    if (rest_.size() < count * sizeof(float)) {
      return wrong(what,
                   fmt::format("the file is cut off: got {} bytes, wanted {}", rest_.size(), count * sizeof(float)));
    }
    values.resize(count);  // not before: a line may ask for more than any machine has
    std::memcpy(values.data(), rest_.data(), count * sizeof(float));
    rest_.remove_prefix(count * sizeof(float));
    for (std::size_t i = 0; i < count; ++i) {
      if (!std::isfinite(values[i]))
        return wrong(what, fmt::format("value {}: got {}, wanted a finite number", i, values[i]));
    }
    return {};
  }

  std::optional<Error> end() const {
    if (rest_.empty()) return {};
    return wrong("end", fmt::format("got {} bytes after the last layer, wanted none", rest_.size()));
  }

 private:
  std::string_view take_line() {
    const auto length = rest_.find('\n');
    const std::string_view line = rest_.substr(0, length);
    rest_.remove_prefix(length == std::string_view::npos ? rest_.size() : length + 1);
    return line;
  }

  std::string_view rest_;
  std::string origin_;
};

// All the lines, in order. Stops at the first error.
std::optional<Error> read_header(Parser& parser, Network& network, std::vector<double>& widths) {
  std::vector<double> parking;
  double samples = 0.0;
  const std::function<std::optional<Error>()> lines[] = {
      [&] { return parser.first_line(); },
      [&] { return parser.number("pusher_radius", 1e-4, 1.0, network.bodies.pusher_radius); },
      [&] { return parser.number("slider_radius", 1e-4, 1.0, network.bodies.slider_radius); },
      [&] { return parser.number("slider_height", 1e-4, 1.0, network.slider_height); },
      [&] { return parser.number("slider_mass", 1e-4, 100.0, network.slider_mass); },
      [&] { return parser.number("slider_friction", 1e-3, 10.0, network.bodies.slider_friction); },
      [&] { return parser.number("duration", 1e-3, 60.0, network.duration); },
      [&] { return parser.number("longest_way", 1e-3, 10.0, network.longest_way); },
      [&] { return parser.number("samples", 0.0, 1e15, samples); },
      [&] { return parser.numbers("parking", 2 * kSlots, -10.0, 10.0, parking); },
      [&] { return parser.floats("input_mean", kInputs, -1e3, 1e3, network.input_mean); },
      [&] { return parser.floats("input_scale", kInputs, 1e-6, 1e3, network.input_scale); },
      [&] { return parser.floats("output_scale", kOutputs, 1e-6, 1e3, network.output_scale); },
      [&] { return parser.numbers("layers", 0, 1, kMaxWidth, widths); },
  };
  for (const auto& line : lines) {
    if (auto error = line()) return error;
  }
  network.samples = static_cast<std::uint64_t>(samples);
  for (std::size_t i = 0; i < kSlots; ++i) network.parking[i] = {parking[2 * i], parking[2 * i + 1]};
  return {};
}

std::optional<Error> check_widths(const Parser& parser, const std::vector<double>& widths) {
  if (widths.size() < 2 || widths.size() > kMaxLayers + 1) {
    return parser.wrong("layers", fmt::format("got {} widths, wanted 2 to {}", widths.size(), kMaxLayers + 1));
  }
  for (const double width : widths) {
    if (width != std::floor(width))
      return parser.wrong("layers", fmt::format("got {} neurons, wanted a whole number", width));
  }
  if (widths.front() != kInputs || widths.back() != kOutputs) {
    return parser.wrong("layers", fmt::format("got {} inputs and {} outputs, wanted {} and {}", widths.front(),
                                              widths.back(), kInputs, kOutputs));
  }
  return {};
}

}  // namespace

Result<Network> parse_network(std::string_view content, const std::string& origin) {
  Parser parser(content, origin);
  Network network;
  std::vector<double> widths;
  if (auto error = read_header(parser, network, widths)) return *error;
  if (auto error = check_widths(parser, widths)) return *error;
  for (std::size_t i = 0; i + 1 < widths.size(); ++i) {
    NetworkLayer layer{.inputs = static_cast<int>(widths[i]), .outputs = static_cast<int>(widths[i + 1])};
    const auto inputs = static_cast<std::size_t>(layer.inputs), outputs = static_cast<std::size_t>(layer.outputs);
    if (auto error = parser.binary(fmt::format("weights of layer {}", i + 1), inputs * outputs, layer.weights))
      return *error;
    if (auto error = parser.binary(fmt::format("biases of layer {}", i + 1), outputs, layer.biases)) return *error;
    network.layers.push_back(std::move(layer));
  }
  if (auto error = parser.end()) return *error;
  return network;
}

Result<Network> load_network(const std::filesystem::path& file) {
  const auto content_result = files::read(file, kMaxBytes);
  if (!content_result)
    return Error{content_result.error().code, fmt::format("{}; {}", content_result.error().message, kRemedy)};
  return parse_network(*content_result, file.string());
}

std::string to_file(const Network& network) {
  std::string text = fmt::format("{} {}\n", kMagic, kVersion);
  const auto line = [&](std::string_view key, const auto& values) {
    text += key;
    for (const auto value : values) fmt::format_to(std::back_inserter(text), " {}", value);
    text += '\n';
  };
  const auto number = [&](std::string_view key, auto value) { line(key, std::array{value}); };
  number("pusher_radius", network.bodies.pusher_radius);
  number("slider_radius", network.bodies.slider_radius);
  number("slider_height", network.slider_height);
  number("slider_mass", network.slider_mass);
  number("slider_friction", network.bodies.slider_friction);
  number("duration", network.duration);
  number("longest_way", network.longest_way);
  number("samples", network.samples);
  std::vector<double> parking;
  for (const auto& place : network.parking) parking.insert(parking.end(), place.begin(), place.end());
  line("parking", parking);
  line("input_mean", network.input_mean);
  line("input_scale", network.input_scale);
  line("output_scale", network.output_scale);
  std::vector<int> widths{network.layers.front().inputs};
  for (const NetworkLayer& layer : network.layers) widths.push_back(layer.outputs);
  line("layers", widths);
  for (const NetworkLayer& layer : network.layers) {
    for (const auto* values : {&layer.weights, &layer.biases}) {
      text.append(reinterpret_cast<const char*>(values->data()), values->size() * sizeof(float));
    }
  }
  return text;
}

}  // namespace jostle::physics_pool
