#include "services/studies/train_coarse/transitions.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string_view>
#include <type_traits>

namespace jostle::studies {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "files are little-endian");
static_assert(std::is_trivially_copyable_v<Transition> && sizeof(Transition) == 4 * (2 * kPlanarSize + 3));
static_assert(std::is_trivially_copyable_v<DataOrigin> && sizeof(DataOrigin) == 80);

constexpr std::string_view kMagic{"jostle-pushes 1\n"};
constexpr std::size_t kHeaderSize = kMagic.size() + sizeof(DataOrigin);

Error refused(const fs::path& file, const std::string& why) {
  return {Code::kIo, fmt::format("{}: {}", file.string(), why)};
}

Error wrong(const fs::path& file, const std::string& why) {
  return {Code::kInvalidArgument, fmt::format("{}: {}", file.string(), why)};
}

Result<DataOrigin> read_header(std::istream& in, const fs::path& file) {
  std::array<char, kHeaderSize> header;
  if (!in.read(header.data(), header.size())) {
    return wrong(file,
                 fmt::format("header: got {} bytes, wanted {}; delete it and collect anew", in.gcount(), kHeaderSize));
  }
  if (std::string_view(header.data(), kMagic.size()) != kMagic) {
    return wrong(file, "magic: wanted 'jostle-pushes 1', a file that jostle train-coarse data has written");
  }
  DataOrigin origin;
  std::memcpy(&origin, header.data() + kMagic.size(), sizeof origin);
  return origin;
}

// The first field that differs.
std::optional<std::string> difference(const DataOrigin& got, const DataOrigin& wanted) {
  if (got.seed != wanted.seed) return fmt::format("seed: the file has {}, this run {}", got.seed, wanted.seed);
  struct Field {
    const char* name;
    double got, wanted;
  };
  const std::array fields{Field{"pusher radius", got.pusher_radius, wanted.pusher_radius},
                          Field{"pusher height", got.pusher_height, wanted.pusher_height},
                          Field{"slider radius", got.slider_radius, wanted.slider_radius},
                          Field{"slider height", got.slider_height, wanted.slider_height},
                          Field{"slider mass", got.slider_mass, wanted.slider_mass},
                          Field{"slider friction", got.slider_friction, wanted.slider_friction},
                          Field{"duration", got.duration, wanted.duration},
                          Field{"time step", got.time_step, wanted.time_step},
                          Field{"speed", got.max_speed, wanted.max_speed}};
  for (const Field& field : fields) {
    if (field.got != field.wanted) {
      return fmt::format("{}: the file has {}, this run {}", field.name, field.got, field.wanted);
    }
  }
  return {};
}

}  // namespace

Result<TransitionFile> read_transitions(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return Error{Code::kNotFound, fmt::format("{}: cannot be opened", file.string())};
  auto origin_result = read_header(in, file);
  if (!origin_result) return origin_result.error();
  TransitionFile content{.origin = *origin_result};
  std::error_code problem;
  const auto bytes = fs::file_size(file, problem);
  if (problem) return refused(file, problem.message());
  content.transitions.resize((bytes - kHeaderSize) / sizeof(Transition));
  const auto wanted = static_cast<std::streamsize>(content.transitions.size() * sizeof(Transition));
  if (!in.read(reinterpret_cast<char*>(content.transitions.data()), wanted)) return refused(file, "cannot be read");
  for (std::size_t i = 0; i < content.transitions.size(); ++i) {
    const Transition& transition = content.transitions[i];
    if (transition.sliders < 1 || transition.sliders > kMaxSliders) {
      return wrong(file, fmt::format("record {}: got {} sliders, wanted 1 to {}; delete it and collect anew", i,
                                     transition.sliders, kMaxSliders));
    }
  }
  return content;
}

Result<TransitionWriter> TransitionWriter::open(const fs::path& file, const DataOrigin& origin, int group) {
  std::error_code problem;
  const auto bytes = fs::exists(file, problem) ? fs::file_size(file, problem) : 0;
  if (problem) return refused(file, problem.message());
  std::uint64_t size = 0;
  if (bytes >= kHeaderSize) {
    std::ifstream in(file, std::ios::binary);
    auto header_result = read_header(in, file);
    if (!header_result) return header_result.error();
    if (const auto what = difference(*header_result, origin)) {
      return wrong(file, *what + "; choose another file, or what it was begun with");
    }
    const auto whole = static_cast<std::uint64_t>(group);
    size = (bytes - kHeaderSize) / sizeof(Transition) / whole * whole;
    fs::resize_file(file, kHeaderSize + size * sizeof(Transition), problem);
    if (problem) return refused(file, problem.message());
  } else if (bytes > 0) {
    std::ifstream in(file, std::ios::binary);
    return read_header(in, file).error();
  }
  std::ofstream out(file, std::ios::binary | std::ios::app);
  if (bytes == 0) {
    out.write(kMagic.data(), static_cast<std::streamsize>(kMagic.size()));
    out.write(reinterpret_cast<const char*>(&origin), sizeof origin);
    out.flush();
  }
  if (!out) return refused(file, "cannot be written");
  return TransitionWriter(file, std::move(out), size);
}

Result<void> TransitionWriter::append(const std::vector<Transition>& transitions) {
  out_.write(reinterpret_cast<const char*>(transitions.data()),
             static_cast<std::streamsize>(transitions.size() * sizeof(Transition)));
  out_.flush();
  if (!out_) return refused(file_, "cannot be written; is the disk full?");
  size_ += transitions.size();
  return {};
}

}  // namespace jostle::studies
