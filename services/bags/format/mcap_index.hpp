#pragma once
/// \file
/// What an MCAP file holds, and where: by its summary if that says all, else after a look at all of
/// its records.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/input_file.hpp"
#include "services/bags/format/mcap_definitions.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "services/bags/format/mcap_records.hpp"
#include "services/bags/format/message.hpp"
#include "services/bags/format/storage.hpp"

namespace jostle::bags::mcap {

/// A file's summary as it stands there.
struct Summary {
  std::optional<Statistics> statistics;
  std::vector<ChunkIndex> chunks;
  std::vector<AttachmentIndex> attachments;
  std::vector<MetadataIndex> metadata;
  std::vector<SummaryOffset> offsets;
  std::vector<Record> records;  ///< all of them, in their order
  std::uint64_t offsets_start = 0;
  bool is_whole = true;  ///< every record of it could be read
};

/// What a look at all records has met, taken or not.
struct Census {
  struct Chunk {
    ChunkIndex index;  ///< as it should be
    ChunkHead head;
    std::uint64_t start = 0, end = 0;  ///< log times of the messages that were met
    std::uint64_t messages = 0;
  };
  std::vector<Chunk> chunks;
  std::vector<AttachmentIndex> attachments;
  std::vector<MetadataIndex> metadata;
  std::map<std::uint16_t, std::uint64_t> messages;  ///< by channel
  std::uint64_t all_messages = 0;
  std::uint64_t start = 0, end = 0;  ///< log times of all messages
};

struct Index {
  FileInfo info;  ///< topics move here from the definitions when it is finished
  Definitions definitions;
  std::vector<Block> blocks;              ///< as they lie in the file
  std::optional<std::uint64_t> repeated;  ///< offset of the chunk that repeats what earlier files hold
  std::vector<Record> attachments;        ///< where those of info.attachments are
  std::optional<Summary> summary;
  std::uint64_t data_end = 0;  ///< where the footer is, or where a file without one ends
  bool was_scanned = false;    ///< all messages have been looked at, and findings speak of all
  bool notes_replace = false;  ///< a note replaces earlier ones of its name: our own writer's do

  Result<void> take_header(const InputFile& file);
  Result<void> take_metadata(const InputFile& file, const Record& record);
  void take_attachment(const Record& record, const AttachmentHead& head);

  /// Finds out where a message belongs, whose record is `offset` bytes behind the beginning of a block's records.
  /// Nothing for one that cannot be given out: why not is added to `findings`, if there are any.
  struct Place {
    int topic = 0;
    Time log_time = 0;
  };
  std::optional<Place> place_of(const InputFile& file, const Block& block, View body, std::uint64_t offset,
                                Findings* findings) const;
};

/// Makes the index of a file.
/// Errors   kInvalidArgument  another kind of file, a later version, or damaged
///          kIo               it cannot be read
/// With OpenOptions::recover it is an error only if the file's first bytes are wrong; FileInfo::findings have the rest.
Result<Index> index_of(const InputFile& file, const OpenOptions& options);

/// Reads the whole file for what index_of() and reading do not look at: checksums, message
/// indexes, and whether it holds what its summary says.
Result<std::vector<Finding>> verify(const InputFile& file, const Index& index, const std::stop_token& stop);

}  // namespace jostle::bags::mcap
