#pragma once
/// \file
/// AprilTags of family 36h11 in images, by libapriltag.

#include <array>
#include <memory>
#include <vector>

#include "perception/camera/image.hpp"

namespace jostle::perception {

struct DetectorOptions {
  /// Quads are looked for in an image this much smaller: faster, and small tags are missed (`jostle bench tags`). Edges
  /// are found and bits are read in the whole image. >= 1
  double decimation = 1.5;
  /// Bits of a tag's 36 that may be wrong, 0 to 2. More finds more, and more often what is no tag.
  int correctable_bits = 1;
  /// What the pattern is sharpened by before its bits are read; helps small tags.
  double sharpening = 0.25;
  /// Where shades differ by less within some pixels, there is nothing to look at: with libapriltag's 5 the noise of a
  /// camera is looked at everywhere, which takes most of the time. Shades, 0 to 255.
  int least_contrast = 40;
  int threads = 1;
};

/// A tag that was seen.
struct Detection {
  int id = 0;
  /// Of the black border: top left, top right, bottom right, bottom left, as one reads the upright tag.
  std::array<Pixel, 4> corners{};
  int wrong_bits = 0;
  double contrast = 0.0;  ///< mean margin of its bits, shades of grey
};

/// Threads  one at a time.
class Detector {
 public:
  explicit Detector(const DetectorOptions& options = {});
  Detector(Detector&&) noexcept;
  Detector& operator=(Detector&&) noexcept;
  ~Detector();

  /// Returns the tags in an image, by id. One that shows twice is there twice. None in an image with a side of less
  /// than 10 decimation pixels: libapriltag 3.3 crashes in small ones.
  std::vector<Detection> detect(const GreyImage& image);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// How many tags there are; ids begin at 0.
int tag_count();

/// Cells along a side of a tag with its white margin, and along one of its black border, whose outer edge is what a
/// tag's size means.
inline constexpr int kTagCells = 10, kTagBorderCells = 8;

/// Returns the picture of a tag, a pixel for each of kTagCells x kTagCells cells. `id`: 0 to tag_count() - 1.
GreyImage tag_cells(int id);

}  // namespace jostle::perception
