#include "perception/tags/detector.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <algorithm>

namespace jostle::perception {
namespace {

// libapriltag: the middle of the top left pixel is (0.5, 0.5).
constexpr double kHalfPixel = 0.5;

struct Deleter {
  void operator()(apriltag_family_t* family) const { tag36h11_destroy(family); }
  void operator()(apriltag_detector_t* detector) const { apriltag_detector_destroy(detector); }
  void operator()(zarray_t* detections) const { apriltag_detections_destroy(detections); }
  void operator()(image_u8_t* image) const { image_u8_destroy(image); }
};
template <class T>
using Handle = std::unique_ptr<T, Deleter>;

const apriltag_family_t& family() {
  static const Handle<apriltag_family_t> tags(tag36h11_create());
  return *tags;
}

Detection detection_of(const apriltag_detection_t& found) {
  Detection detection{.id = found.id, .wrong_bits = found.hamming, .contrast = found.decision_margin};
  // Its corners are bottom left, bottom right, top right, top left.
  for (std::size_t i = 0; i < 4; ++i)
    detection.corners[i] = {found.p[3 - i][0] - kHalfPixel, found.p[3 - i][1] - kHalfPixel};
  return detection;
}

}  // namespace

struct Detector::Parts {
  Handle<apriltag_family_t> family{tag36h11_create()};
  Handle<apriltag_detector_t> detector{apriltag_detector_create()};  // ends before its family
};

Detector::Detector(const DetectorOptions& options) : parts_(std::make_unique<Parts>()) {
  apriltag_detector_t& detector = *parts_->detector;
  apriltag_detector_add_family_bits(&detector, parts_->family.get(), options.correctable_bits);
  detector.quad_decimate = static_cast<float>(options.decimation);
  detector.decode_sharpening = options.sharpening;
  detector.qtp.min_white_black_diff = options.least_contrast;
  detector.nthreads = options.threads;
}

Detector::Detector(Detector&&) noexcept = default;
Detector& Detector::operator=(Detector&&) noexcept = default;
Detector::~Detector() = default;

std::vector<Detection> Detector::detect(const GreyImage& image) {
  // One pixel for each cell of a tag is too little in any case, and libapriltag 3.3 crashes in images of one tile.
  const double least = kTagCells * static_cast<double>(parts_->detector->quad_decimate);
  if (image.width < least || image.height < least) return {};
  // It is not written to: only a blur that nobody asks for would do that.
  image_u8_t view{.width = image.width,
                  .height = image.height,
                  .stride = image.width,
                  .buf = const_cast<std::uint8_t*>(image.pixels.data())};
  const Handle<zarray_t> found(apriltag_detector_detect(parts_->detector.get(), &view));
  std::vector<Detection> detections;
  for (int i = 0; i < zarray_size(found.get()); ++i) {
    apriltag_detection_t* one = nullptr;
    zarray_get(found.get(), i, static_cast<void*>(&one));
    detections.push_back(detection_of(*one));
  }
  std::ranges::stable_sort(detections, {}, &Detection::id);
  return detections;
}

int tag_count() { return static_cast<int>(family().ncodes); }

GreyImage tag_cells(int id) {
  const Handle<image_u8_t> picture(apriltag_to_image(const_cast<apriltag_family_t*>(&family()), id));
  GreyImage cells{.width = picture->width, .height = picture->height};
  for (int y = 0; y < cells.height; ++y) {
    const std::uint8_t* row = picture->buf + static_cast<std::ptrdiff_t>(y) * picture->stride;
    cells.pixels.insert(cells.pixels.end(), row, row + cells.width);
  }
  return cells;
}

}  // namespace jostle::perception
