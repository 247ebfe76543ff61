#pragma once
/// \file
/// Compression of chunks.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

struct ZSTD_CCtx_s;

namespace jostle::bags {

/// A Compressor runs zstd at its fastest level.
class Compressor {
 public:
  Compressor();
  ~Compressor();
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  /// Compresses `data`. The result is valid until the next call; empty if zstd had no memory.
  std::span<const std::byte> compress(std::span<const std::byte> data);

 private:
  ZSTD_CCtx_s* context_;
  std::vector<std::byte> out_;
};

/// Whether decompress() knows a compression: "zstd", "lz4" (frames), or "" for none.
bool is_known_compression(const std::string& name);

/// Decompresses `data`; nothing if it is damaged, or holds other than `size` bytes. Takes memory for what comes
/// out, not for what `size` claims.
std::optional<std::vector<std::byte>> decompress(const std::string& name, std::span<const std::byte> data,
                                                 std::uint64_t size);

}  // namespace jostle::bags
