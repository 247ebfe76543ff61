// MCAP beyond what BagWriter writes: files of other tools, and damaged ones.

#include <gmock/gmock.h>
#include <lz4frame.h>
#include <sys/resource.h>

#include <fstream>

#include "services/bags/format/checksum.hpp"
#include "services/bags/format/compression.hpp"
#include "services/bags/format/folder_reader.hpp"
#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/mcap_format.hpp"
#include "tests/support/bags.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
namespace mcap = bags::mcap;
using bags::BagReader;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// As other tools lay files out, which BagWriter does not.
class McapFile : public ::testing::Test {
 protected:
  static mcap::Schema schema() {
    return {.id = 1, .name = "std_msgs/msg/String", .encoding = "ros2msg", .data = "string data"};
  }
  static mcap::Channel channel(std::uint16_t id, const std::string& topic) {
    return {.id = id, .schema = 1, .topic = topic, .encoding = "cdr"};
  }
  static Bytes beginning() {
    Bytes bytes;
    mcap::append_magic(bytes);
    mcap::append_header(bytes, "ros2", "another tool");
    return bytes;
  }
  static void append_message(Bytes& to, std::uint16_t channel, std::uint64_t time, const std::string& text) {
    mcap::append_message(to, {.channel = channel, .sequence = 1, .log_time = time, .publish_time = time}, cdr_of(text));
  }
  static void append_chunk(Bytes& to, const Bytes& records, const std::string& compression, const Bytes& stored,
                           bool with_crc = true) {
    mcap::append(to, mcap::ChunkHead{.start = 0,
                                     .end = 1000,
                                     .size = records.size(),
                                     .crc = with_crc ? bags::crc32_of(records) : 0,
                                     .compression = compression,
                                     .stored = stored.size()});
    mcap::Appender(to).bytes(stored);
  }
  static void append_end(Bytes& to) {
    mcap::append_data_end(to, 0);
    mcap::append_footer(to, 0, 0, 0);
    mcap::append_magic(to);
  }
  static Bytes lz4(const Bytes& data) {
    Bytes out(LZ4F_compressFrameBound(data.size(), nullptr));
    out.resize(LZ4F_compressFrame(out.data(), out.size(), data.data(), data.size(), nullptr));
    return out;
  }
  static Bytes zstd(const Bytes& data) {
    bags::Compressor compressor;
    const auto smaller = compressor.compress(data);
    return {smaller.begin(), smaller.end()};
  }

  fs::path save(const Bytes& bytes, const std::string& name = "other.mcap") const {
    return folder_.write(name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  std::vector<std::string> texts(const Bytes& bytes) const {
    return texts_of(rest_of(*taken(BagReader::open(save(bytes)))));
  }

  TempFolder folder_;
};

TEST_F(McapFile, IsReadWithoutSummaryOrChunks) {  // rosbag2's preset fastwrite
  Bytes bytes = beginning();
  mcap::append(bytes, schema());
  mcap::append(bytes, channel(7, "/x"));
  append_message(bytes, 7, 20, "later");
  append_message(bytes, 7, 10, "earlier");
  append_end(bytes);
  const auto sut = taken(BagReader::open(save(bytes)));
  EXPECT_EQ(sut->info().messages, 2u);
  EXPECT_EQ(sut->info().start, 10);
  EXPECT_EQ(sut->info().topics[0].topic.definition, "string data");
  EXPECT_THAT(texts_of(rest_of(*sut)), ElementsAre("earlier", "later"));
  EXPECT_EQ(text_of(taken(sut->last_at(0, 15))->data), "earlier");
}

TEST_F(McapFile, IsReadWithEveryCompression) {
  Bytes records;
  mcap::append(records, schema());
  mcap::append(records, channel(0, "/x"));
  for (std::uint64_t i = 0; i < 100; ++i) append_message(records, 0, i, "the same text again and again");
  for (const auto& [name, stored] :
       {std::pair<std::string, Bytes>{"", records}, {"lz4", lz4(records)}, {"zstd", zstd(records)}}) {
    Bytes bytes = beginning();
    append_chunk(bytes, records, name, stored);
    append_end(bytes);
    EXPECT_EQ(texts(bytes).size(), 100u) << name;
  }
  Bytes bytes = beginning();
  append_chunk(bytes, records, "xz", records);
  append_end(bytes);
  EXPECT_THAT(BagReader::open(save(bytes)).error().message,
              HasSubstr("got compression 'xz', wanted zstd, lz4 or none"));
}

TEST_F(McapFile, IsReadWithoutChecksum) {
  Bytes records;
  mcap::append(records, schema());
  mcap::append(records, channel(0, "/x"));
  append_message(records, 0, 1, "x");
  Bytes bytes = beginning();
  append_chunk(bytes, records, "", records, false);
  append_end(bytes);
  EXPECT_THAT(texts(bytes), ElementsAre("x"));
}

TEST_F(McapFile, IsReadInOrderOfTimeWhereChunksOverlap) {
  Bytes first, second, third;
  mcap::append(first, schema());
  mcap::append(first, channel(0, "/x"));
  append_message(first, 0, 10, "10");
  append_message(first, 0, 40, "40");
  append_message(second, 0, 20, "20");
  append_message(second, 0, 40, "40 again");
  append_message(third, 0, 5, "5");
  append_message(third, 0, 30, "30");
  Bytes bytes = beginning();
  for (const Bytes& records : {first, second, third}) append_chunk(bytes, records, "", records);
  append_end(bytes);
  const auto sut = taken(BagReader::open(save(bytes)));
  EXPECT_THAT(texts_of(rest_of(*sut)), ElementsAre("5", "10", "20", "30", "40", "40 again"));
  EXPECT_EQ(text_of(taken(sut->last_at(0, 100))->data), "40 again");
  EXPECT_EQ(text_of(taken(sut->last_at(0, 39))->data), "30");
  EXPECT_EQ(text_of(taken(sut->last_at(0, 9))->data), "5");
}

TEST_F(McapFile, JoinsChannelsOfOneTopic) {
  Bytes bytes = beginning();
  mcap::append(bytes, schema());
  mcap::append(bytes, channel(1, "/x"));
  mcap::append(bytes, channel(2, "/x"));
  append_message(bytes, 1, 1, "of one writer");
  append_message(bytes, 2, 2, "of another");
  append_end(bytes);
  const auto sut = taken(BagReader::open(save(bytes)));
  ASSERT_EQ(sut->info().topics.size(), 1u);
  EXPECT_EQ(sut->info().topics[0].messages, 2u);
  EXPECT_EQ(texts_of(rest_of(*sut)).size(), 2u);
}

TEST_F(McapFile, SaysWhatItCannotRead) {
  Bytes bytes = beginning();
  append_end(bytes);
  bytes[5] = std::byte{'1'};
  EXPECT_THAT(BagReader::open(save(bytes)).error().message, HasSubstr("a later program wrote it"));
}

TEST_F(McapFile, TakesNoMemoryForWhatItOnlyClaims) {
  // More than this machine has, wherever a length is told.
  constexpr std::uint64_t kAbsurd = std::uint64_t{1} << 60;
  Bytes records;
  append_message(records, 0, 1, "x");
  for (const std::string compression : {"", "lz4", "zstd"}) {
    const Bytes stored = compression.empty() ? records : compression == "lz4" ? lz4(records) : zstd(records);
    Bytes bytes = beginning();
    mcap::append(bytes, mcap::ChunkHead{.size = kAbsurd, .compression = compression, .stored = stored.size()});
    mcap::Appender(bytes).bytes(stored);
    append_end(bytes);
    EXPECT_THAT(BagReader::open(save(bytes)).error().message, HasSubstr("cannot be decompressed"));
  }
  Bytes bytes = beginning();
  const std::size_t at = bytes.size();
  append_message(bytes, 0, 1, "x");
  std::memcpy(bytes.data() + at + 1, &kAbsurd, sizeof kAbsurd);
  append_end(bytes);
  EXPECT_THAT(BagReader::open(save(bytes)).error().message, HasSubstr("byte " + std::to_string(at)));
}

// A small file as BagWriter writes it: two topics, three chunks, one of which repeats others.
class DamagedMcap : public McapFile, public ::testing::WithParamInterface<bool> {
 protected:
  void SetUp() override {
    const fs::path bag = folder_.path() / "bag";
    const auto writer =
        taken(bags::BagWriter::create(bag, {.compress = GetParam(), .split_time = std::chrono::nanoseconds(5)}));
    const int map = taken(writer->add_topic(string_topic("/map", kLatched)));
    const int x = taken(writer->add_topic(string_topic("/x")));
    taken(writer->write(map, {.log_time = 1, .publish_time = 1, .data = cdr_of("map")}));
    for (int i = 1; i < 9; ++i) {
      taken(writer->write(
          x, {.log_time = i, .publish_time = i, .data = cdr_of(std::string(40, 'a') + std::to_string(i))}));
      if (i == 7) taken(writer->flush());
    }
    writer->set_note("record", {{"key", "value"}});
    taken(writer->close());
    const std::string text = contents(bag / "bag_1.mcap");
    ASSERT_LT(text.size(), 4000u);
    const auto view = std::as_bytes(std::span(text));
    bytes_.assign(view.begin(), view.end());
    wanted_ = read(save(bytes_));
    ASSERT_EQ(wanted_.size(), 4u);
  }

  // The second file's chunk of repeated samples, with its last byte changed.
  void damage_repeated() {
    const fs::path file = folder_.path() / "bag" / "bag_1.mcap";
    std::string text = contents(file);
    constexpr std::size_t kHead = 9;  // opcode and length
    const auto end_of = [&](std::size_t record) {
      std::uint64_t size = 0;
      std::memcpy(&size, text.data() + record + 1, sizeof size);
      return record + kHead + size;
    };
    const std::size_t note = text.find(bags::kRepeatedNote) - sizeof(std::uint32_t) - kHead;
    text[end_of(end_of(note)) - 1] ^= 1;
    std::ofstream(file, std::ios::trunc | std::ios::binary) << text;
  }

  // Messages by topic name, so that an order of topics does not matter. An error must name the file.
  std::vector<std::pair<std::string, Bytes>> read(const fs::path& file) const {
    std::vector<std::pair<std::string, Bytes>> got;
    is_error_ = true;
    auto opened = BagReader::open(file);
    if (!opened) {
      EXPECT_THAT(opened.error().message, HasSubstr(file.string()));
      return got;
    }
    while (true) {
      auto message = (*opened)->next();
      if (!message) {
        EXPECT_THAT(message.error().message, HasSubstr(file.string()));
        return got;
      }
      if (!*message) break;
      got.emplace_back((*opened)->info().topics[static_cast<std::size_t>((*message)->topic)].topic.name,
                       (*message)->data);
    }
    for (int topic = 0; topic < static_cast<int>((*opened)->info().topics.size()); ++topic) {
      (void)(*opened)->last_at(topic, 7);
    }
    is_error_ = false;
    return got;
  }
  // Damage must not make recovering crash or hang either. How many messages it gave.
  std::size_t recover(const fs::path& file) const {
    std::size_t count = 0;
    const auto saved = bags::open_bag(file, true);
    if (!saved) return 0;
    while (true) {
      const auto message = (*saved)->next();
      if (!message || !*message) return count;
      ++count;
    }
  }

  Bytes bytes_;
  std::vector<std::pair<std::string, Bytes>> wanted_;
  mutable bool is_error_ = false;
};

TEST_P(DamagedMcap, GivesAnErrorWhereverItIsCutOff) {
  std::size_t most = 0;
  for (std::size_t size = 0; size < bytes_.size(); ++size) {
    const fs::path file = save({bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(size)});
    EXPECT_EQ(read(file).size(), 0u) << "cut at " << size;
    EXPECT_TRUE(is_error_) << "cut at " << size;
    const std::size_t saved = recover(file);
    EXPECT_GE(saved, most) << "cut at " << size;  // a longer file never gives less
    most = std::max(most, saved);
  }
  EXPECT_EQ(most, wanted_.size());
}

TEST_P(DamagedMcap, GivesAnErrorOrTheSameMessagesWhateverByteIsWrong) {
  int errors = 0, noticed = 0;
  for (std::size_t at = 0; at < bytes_.size(); ++at) {
    // A little and entirely, in turns: both would take twice as long.
    const auto flip = static_cast<std::byte>(at % 2 == 0 ? 0x01 : 0xFF);
    Bytes damaged = bytes_;
    damaged[at] ^= flip;
    const fs::path file = save(damaged);
    const auto got = read(file);
    EXPECT_TRUE(is_error_ || got == wanted_) << "byte " << at;
    EXPECT_LE(recover(file), wanted_.size()) << "byte " << at;
    if (is_error_) {
      ++errors;
    } else if (!taken(bags::open_bag(file, false))->verify({})) {
      ++noticed;  // what reading did not meet
    }
  }
  EXPECT_GT(errors, static_cast<int>(bytes_.size() / 2));
  EXPECT_GT(noticed, 0);
}

TEST_P(DamagedMcap, IsVerifiedToTheLastByteOfItsData) {
  ASSERT_TRUE(taken(bags::open_bag(save(bytes_), false))->verify({}));
  // Of the library's name, which nobody reads.
  Bytes damaged = bytes_;
  damaged[30] ^= std::byte{1};
  const auto sut = taken(bags::open_bag(save(damaged), false));
  EXPECT_THAT(sut->verify({}).error().message, HasSubstr("data: got checksum"));
}

TEST_P(DamagedMcap, LosesNothingWhereOnlyRepeatedSamplesAreDamaged) {
  damage_repeated();

  const auto sut = taken(bags::open_bag(folder_.path() / "bag", true));

  EXPECT_FALSE(sut->findings().empty());
  EXPECT_EQ(rest_of(*sut).size(), 9u);
  EXPECT_EQ(sut->info().messages, 9u);
}

INSTANTIATE_TEST_SUITE_P(Compressed, DamagedMcap, ::testing::Values(true));
INSTANTIATE_TEST_SUITE_P(Uncompressed, DamagedMcap, ::testing::Values(false));

TEST(Decompress, RefusesWhatIsLongerOrShorterThanToldAndTakesTheRightSize) {
  const Bytes data = noise(300'000, 3);
  bags::Compressor compressor;
  const auto smaller = compressor.compress(data);
  EXPECT_EQ(bags::decompress("zstd", smaller, data.size()), data);
  EXPECT_FALSE(bags::decompress("zstd", smaller, data.size() - 1));
  EXPECT_FALSE(bags::decompress("zstd", smaller, data.size() + 1));
  EXPECT_FALSE(bags::decompress("zstd", smaller.first(smaller.size() - 1), data.size()));
  EXPECT_FALSE(bags::decompress("zstd", smaller, 0));
  const Bytes zeros(50'000'000);
  EXPECT_TRUE(bags::decompress("zstd", compressor.compress(zeros), zeros.size()) == zeros);
  EXPECT_EQ(bags::decompress("", {}, 0), Bytes());
}

}  // namespace
}  // namespace jostle::tests
