#include "services/bags/format/compression.hpp"

#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>

namespace jostle::bags {
namespace {

using Bytes = std::vector<std::byte>;
using View = std::span<const std::byte>;

constexpr int kFastest = 1;

// What one call of a decompressor did.
struct Step {
  std::size_t in = 0, out = 0;
  bool failed = false;
  bool is_done = false;  // a frame has ended
};

// Calls step(data, room) until the input is used up. Room grows as it is filled: a size
// that a damaged file claims costs nothing.
template <class StepFunction>
std::optional<Bytes> run(View data, std::uint64_t size, StepFunction step) {
  constexpr std::uint64_t kFirst = 256 << 10;
  Bytes out(static_cast<std::size_t>(std::min(size, std::max<std::uint64_t>(kFirst, 8 * data.size()))));
  std::size_t filled = 0;
  bool is_done = data.empty();
  std::byte nothing{};  // decompressors want a place to write to even when nothing is left
  while (!data.empty()) {
    if (filled == out.size() && out.size() < size) {
      out.resize(static_cast<std::size_t>(std::min(size, std::uint64_t{out.size()} * 2)));
    }
    const std::span<std::byte> room = std::span(out).subspan(filled);
    const Step done = step(data, room.empty() ? std::span(&nothing, 0) : room);
    if (done.failed || (done.in == 0 && done.out == 0)) return {};
    data = data.subspan(done.in);
    filled += done.out;
    is_done = done.is_done;
    // All input taken, output still to come.
    while (data.empty() && !is_done) {
      if (filled == out.size()) {
        if (out.size() >= size) return {};
        out.resize(static_cast<std::size_t>(std::min(size, std::uint64_t{out.size()} * 2)));
      }
      const Step more = step(data, std::span(out).subspan(filled));
      if (more.failed || more.out == 0) return {};
      filled += more.out;
      is_done = more.is_done;
    }
  }
  if (!is_done || filled != size) return {};
  out.resize(filled);
  return out;
}

std::optional<Bytes> from_zstd(View data, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  if (!context) return {};
  return run(data, size, [&](View in, std::span<std::byte> room) {
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer to{room.data(), room.size(), 0};
    const std::size_t hint = ZSTD_decompressStream(context.get(), &to, &from);
    return Step{from.pos, to.pos, ZSTD_isError(hint) != 0, hint == 0};
  });
}

std::optional<Bytes> from_lz4(View data, std::uint64_t size) {
  LZ4F_dctx* raw = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION)) != 0) return {};
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(raw,
                                                                                     LZ4F_freeDecompressionContext);
  return run(data, size, [&](View in, std::span<std::byte> room) {
    std::size_t taken = in.size(), given = room.size();
    const std::size_t hint = LZ4F_decompress(context.get(), room.data(), &given, in.data(), &taken, nullptr);
    return Step{taken, given, LZ4F_isError(hint) != 0, hint == 0};
  });
}

}  // namespace

Compressor::Compressor() : context_(ZSTD_createCCtx()) {}

Compressor::~Compressor() { ZSTD_freeCCtx(context_); }

View Compressor::compress(View data) {
  const std::size_t bound = ZSTD_compressBound(data.size());
  if (out_.size() < bound) out_.resize(bound);
  if (context_ == nullptr) return {};
  const std::size_t size = ZSTD_compressCCtx(context_, out_.data(), out_.size(), data.data(), data.size(), kFastest);
  return ZSTD_isError(size) != 0 ? View{} : View(out_).first(size);
}

bool is_known_compression(const std::string& name) { return name.empty() || name == "zstd" || name == "lz4"; }

std::optional<Bytes> decompress(const std::string& name, View data, std::uint64_t size) {
  if (name == "zstd") return from_zstd(data, size);
  if (name == "lz4") return from_lz4(data, size);
  if (!name.empty() || data.size() != size) return {};
  return Bytes(data.begin(), data.end());
}

}  // namespace jostle::bags
