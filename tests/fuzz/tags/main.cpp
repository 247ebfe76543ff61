// Spoilt images of tags, to what looks for tags and to what makes poses of them.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "perception/camera/camera.hpp"
#include "perception/tags/detector.hpp"
#include "perception/tags/pose.hpp"
#include "tests/fuzz/fuzz_main.hpp"
#include "tests/fuzz/wire/mutation.hpp"

namespace jostle::tests {
namespace {

using namespace perception;

constexpr int kLargest = 160;  // pixels: small images, so that many are looked at

class Fuzzer {
 public:
  Fuzzer(long inputs, std::uint64_t seed) : inputs_(inputs), random_(seed) {}

  void run() {
    long found = 0, poses = 0;
    for (long i = 0; i < inputs_; ++i) {
      const GreyImage image = spoilt();
      Detector& detector = detectors_[below(2)];
      for (const Detection& detection : detector.detect(image)) {
        ++found;
        check(detection, image);
        poses += pose(detection, image);
      }
    }
    // Most are still legible: else nothing but refusals was tried.
    if (found < inputs_ / 10) throw std::runtime_error(fmt::format("only {} tags in {} images", found, inputs_));
    fmt::print("{} images, {} tags found, {} poses\n", inputs_, found, poses);
  }

 private:
  int below(int bound) { return static_cast<int>(random_() % static_cast<std::uint64_t>(bound)); }
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

  // A tag, turned and stretched, on grey.
  GreyImage tag() {
    const GreyImage cells = tag_cells(below(tag_count()));
    GreyImage image{.width = 24 + below(kLargest - 24), .height = 24 + below(kLargest - 24)};
    const double turn = between(0, 2 * M_PI), scale = between(1.5, 8), stretch = between(0.5, 1);
    const double lean = between(-0.003, 0.003);
    const double middle_x = image.width / 2.0, middle_y = image.height / 2.0;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const double depth = 1 + lean * (x - middle_x);
        const double u = (x - middle_x) / (scale * depth), v = (y - middle_y) / (scale * stretch * depth);
        const int column = static_cast<int>(std::floor(std::cos(turn) * u + std::sin(turn) * v + cells.width / 2.0));
        const int row = static_cast<int>(std::floor(std::cos(turn) * v - std::sin(turn) * u + cells.height / 2.0));
        const bool inside = column >= 0 && row >= 0 && column < cells.width && row < cells.height;
        image.pixels.push_back(inside ? cells.at(column, row) : 128);
      }
    }
    return image;
  }

  void draw_bar(GreyImage& image) {
    const int left = below(image.width), top = below(image.height);
    const int right = left + below(image.width - left) + 1, bottom = top + below(image.height - top) + 1;
    const auto shade = static_cast<std::uint8_t>(random_());
    for (int y = top; y < std::min(bottom, image.height); ++y) {
      for (int x = left; x < std::min(right, image.width); ++x)
        image
            .pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x)] =
            shade;
    }
  }

  GreyImage spoilt() {
    GreyImage image = tag();
    switch (below(6)) {
      case 0:
        return image;
      case 1:
        draw_bar(image);
        return image;
      case 2:  // bytes that are missing, too many or other ones, and rows of another length
        image.pixels = mutated(std::move(image.pixels), 0, random_);
        image.width = 1 + below(2 * image.width);
        image.height = static_cast<int>(image.pixels.size()) / image.width;
        if (image.height == 0) image = {.width = 1, .height = 1, .pixels = {0}};
        image.pixels.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
        return image;
      case 3: {
        const int strength = 1 + below(120);
        for (std::uint8_t& pixel : image.pixels)
          pixel = static_cast<std::uint8_t>(std::clamp(pixel + below(2 * strength + 1) - strength, 0, 255));
        return image;
      }
      case 4:  // a few rows only, or one
        image.height = 1 + below(8);
        image.pixels.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
        return image;
      default:
        for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(255 - pixel);
        draw_bar(image);
        return image;
    }
  }

  static void check(const Detection& detection, const GreyImage& image) {
    if (detection.id < 0 || detection.id >= tag_count()) throw std::runtime_error("a tag that does not exist");
    if (detection.wrong_bits < 0 || detection.wrong_bits > DetectorOptions{}.correctable_bits)
      throw std::runtime_error("a tag of too many wrong bits");
    for (const Pixel& corner : detection.corners) {
      const bool near = std::abs(corner.x) < 4 * image.width + 16 && std::abs(corner.y) < 4 * image.height + 16;
      if (!near) throw std::runtime_error(fmt::format("a corner at ({}, {})", corner.x, corner.y));
    }
  }

  // Whether there is one; it must be finite.
  bool pose(const Detection& detection, const GreyImage& image) {
    const Camera camera{.width = image.width,
                        .height = image.height,
                        .fx = between(50, 2000),
                        .fy = between(50, 2000),
                        .cx = image.width / 2.0,
                        .cy = image.height / 2.0,
                        .distortion = {between(-0.3, 0.3), between(-0.1, 0.1), 0, 0, 0}};
    const TagView view{.corners = detection.corners, .size = between(0.01, 0.2)};
    const auto estimate = estimate_pose(camera, {&view, 1});
    if (!estimate) return false;
    const auto finite = [](double value) { return std::isfinite(value); };
    if (!std::ranges::all_of(estimate->best.X_CB.position, finite) ||
        !std::ranges::all_of(estimate->best.X_CB.orientation, finite) || !finite(estimate->best.error_px))
      throw std::runtime_error("a pose that is not finite");
    return true;
  }

  const long inputs_;
  std::mt19937_64 random_;
  Detector detectors_[2]{Detector(), Detector({.decimation = 1.0})};
};

}  // namespace
}  // namespace jostle::tests

int main(int argc, char** argv) {
  long inputs = 1'000'000;
  return jostle::tests::fuzz_main(argc, argv, "Looks for tags in spoilt images, and makes poses of what it finds.",
                                  {{"--inputs", "Images", &inputs}},
                                  [&](std::uint64_t seed) { jostle::tests::Fuzzer(inputs, seed).run(); });
}
