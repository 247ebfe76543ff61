#pragma once
/// \file
/// What an MCAP file holds, and where: by its summary if it has one, else after a look at all of
/// its records.

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/input_file.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "services/bags/format/mcap_records.hpp"
#include "services/bags/format/message.hpp"
#include "services/bags/format/storage.hpp"

namespace jostle::bags::mcap {

/// What tells where a message belongs.
struct Place {
  std::uint16_t channel = 0;
  int topic = 0;
  Time log_time = 0;
};

struct Index {
  FileInfo info;
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, int> topics;            ///< index into info.topics, by channel
  std::map<std::uint16_t, std::uint64_t> counts;  ///< messages, by channel
  std::vector<Block> blocks;                      ///< as they lie in the file
  std::optional<std::uint64_t> repeated;          ///< offset of the chunk that repeats what earlier files hold

  /// Takes in a Schema or a Channel; the first of an id counts. `offset`: where the record, or its block, is.
  Result<void> take_definition(const InputFile& file, Op op, View body, std::uint64_t offset);
  Result<void> take_metadata(const InputFile& file, const Record& record);

  /// Returns the place of a message whose record is `offset` bytes behind the beginning of a block's records.
  Result<Place> place_of(const InputFile& file, const Block& block, View body, std::uint64_t offset) const;
  std::uint64_t count_of(std::uint16_t channel) const;
};

/// Makes the index of a file.
/// Errors   kInvalidArgument  another kind of file, a later version, or damaged
///          kIo               it cannot be read
/// With OpenOptions::recover it is an error only if the file's first bytes are wrong; FileInfo::damage has the rest.
Result<Index> index_of(const InputFile& file, const OpenOptions& options);

/// Reads the whole file for what index_of() and reading do not look at: checksums, message
/// indexes, and whether it holds what `index` says. `options`: those of index_of().
Result<void> verify(const InputFile& file, const Index& index, const OpenOptions& options);

}  // namespace jostle::bags::mcap
