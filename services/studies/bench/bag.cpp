// What writing bags costs: BagWriter against write() with nothing around it.

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <random>
#include <span>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/bag_writer.hpp"
#include "services/common/process/files.hpp"
#include "services/studies/bench/benchmarks.hpp"

namespace jostle::studies {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kMessageBytes = 1024;
constexpr int kMessages = 100'000;
constexpr std::size_t kBufferBytes = 1 << 20;  // as large as a chunk

// One after the other. Half of each is the same in all of them, half is noise: zstd makes
// about half of it.
std::vector<std::byte> make_messages() {
  std::vector<std::byte> bytes(kMessageBytes * kMessages);
  std::mt19937_64 random(1);
  for (std::size_t at = 0; at < bytes.size(); at += kMessageBytes) {
    for (std::size_t i = kMessageBytes / 2; i < kMessageBytes; i += sizeof(std::uint64_t)) {
      const std::uint64_t value = random();
      std::memcpy(bytes.data() + at + i, &value, sizeof value);
    }
  }
  return bytes;
}

std::span<const std::byte> message(const std::vector<std::byte>& bytes, int index) {
  return std::span(bytes).subspan(static_cast<std::size_t>(index) * kMessageBytes, kMessageBytes);
}

Hash hash_of_bytes(std::span<const std::byte> bytes) {
  return hash_of(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

// Times every call of write(i), and all of them.
class Stopwatch {
 public:
  template <class Write>
  Result<double> rate(Write write) {
    const auto begin = Clock::now();
    auto before = begin;
    for (int i = 0; i < kMessages; ++i) {
      if (auto ok = write(i); !ok) return ok.error();
      const auto after = Clock::now();
      worst_ = std::max(worst_, after - before);
      before = after;
    }
    return kMessages / std::chrono::duration<double>(before - begin).count();
  }
  double worst_us() const { return std::chrono::duration<double, std::micro>(worst_).count(); }

 private:
  Clock::duration worst_{0};
};

struct Kind {
  const char* name;
  bags::BagOptions options;
};

class BagSides {
 public:
  BagSides(const std::vector<std::byte>& bytes, fs::path folder) : bytes_(bytes), folder_(std::move(folder)) {}

  Result<Sample> write_bag(const bags::BagOptions& options) {
    const fs::path path = folder_ / "bag";
    auto sample = write_and_read(path, options);
    std::error_code ignored;
    fs::remove_all(path, ignored);
    return sample;
  }

  Result<Sample> write_bare() {
    const fs::path path = folder_ / "bare";
    auto sample = append_and_read(path);
    std::error_code ignored;
    fs::remove(path, ignored);
    return sample;
  }

  Stopwatch bag_watch, bare_watch;
  std::uint64_t bag_bytes = 0;
  std::vector<double> read_rates;  // messages/s

 private:
  Result<Sample> write_and_read(const fs::path& path, const bags::BagOptions& options) {
    auto writer_result = bags::BagWriter::create(path, options);
    if (!writer_result) return writer_result.error();
    const auto topic_result = (*writer_result)->add_topic({.name = "/x", .type = "some_msgs/msg/Bytes"});
    if (!topic_result) return topic_result.error();
    const auto rate_result = bag_watch.rate([&](int i) -> Result<void> {
      if (auto ok =
              (*writer_result)->write(*topic_result, {.log_time = i, .publish_time = i, .data = message(bytes_, i)});
          !ok) {
        return ok;
      }
      return i + 1 < kMessages ? Result<void>() : (*writer_result)->flush();
    });
    if (!rate_result) return rate_result.error();
    if (auto ok = (*writer_result)->close(); !ok) return ok.error();
    bag_bytes = (*writer_result)->bytes();

    auto reader_result = bags::BagReader::open(path);
    if (!reader_result) return reader_result.error();
    std::vector<std::byte> back;
    back.reserve(bytes_.size());
    const auto begin = Clock::now();
    while (true) {
      auto message_result = (*reader_result)->next();
      if (!message_result) return message_result.error();
      if (!*message_result) break;
      back.insert(back.end(), (*message_result)->data.begin(), (*message_result)->data.end());
    }
    read_rates.push_back(kMessages / std::chrono::duration<double>(Clock::now() - begin).count());
    return Sample{.value = *rate_result, .hash = hash_of_bytes(back)};
  }

  Result<Sample> append_and_read(const fs::path& path) {
    const Error failure{Code::kIo, fmt::format("{}: cannot be written", path.string())};
    const int file = open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (file < 0) return failure;
    std::vector<std::byte> buffer;
    buffer.reserve(kBufferBytes + kMessageBytes);
    const auto rate_result = bare_watch.rate([&](int i) -> Result<void> {
      const auto data = message(bytes_, i);
      buffer.insert(buffer.end(), data.begin(), data.end());
      if (buffer.size() < kBufferBytes && i + 1 < kMessages) return {};
      const bool is_written = write(file, buffer.data(), buffer.size()) == static_cast<ssize_t>(buffer.size());
      buffer.clear();
      return is_written ? Result<void>() : failure;
    });
    std::vector<std::byte> back(bytes_.size());
    std::size_t filled = 0;
    while (filled < back.size()) {
      const ssize_t got = pread(file, back.data() + filled, back.size() - filled, static_cast<off_t>(filled));
      if (got <= 0) break;
      filled += static_cast<std::size_t>(got);
    }
    close(file);
    if (!rate_result) return rate_result.error();
    return Sample{.value = *rate_result, .hash = hash_of_bytes(back)};
  }

  const std::vector<std::byte>& bytes_;
  const fs::path folder_;
};

}  // namespace

Result<void> measure_bag(const Settings& settings) {
  const auto folder_result = common::make_temporary_folder("bench");
  if (!folder_result) return folder_result.error();
  const std::vector<std::byte> bytes = make_messages();
  const Kind kinds[] = {{"mcap zstd", {}},
                        {"mcap raw", {.compress = false}},
                        {"sqlite3", {.storage = bags::BagOptions::Storage::kSqlite}}};
  settings.announce(static_cast<int>(std::size(kinds)));
  const auto measure = [&]() -> Result<void> {
    for (const Kind& kind : kinds) {
      BagSides sides(bytes, *folder_result);
      auto measurement_result = compare({kind.name, [&] { return sides.write_bag(kind.options); }},
                                        {"bare appends", [&] { return sides.write_bare(); }}, settings.turns());
      if (!measurement_result) return measurement_result.error();
      measurement_result->name = fmt::format("bag, {}", kind.name);
      measurement_result->unit = "messages/s";
      measurement_result->details = {{"worst write() of the bag, us", sides.bag_watch.worst_us()},
                                     {"worst bare append, us", sides.bare_watch.worst_us()},
                                     {"read back, messages/s", common::median(sides.read_rates)},
                                     {"size of the bag, of the bytes in it",
                                      static_cast<double>(sides.bag_bytes) / static_cast<double>(bytes.size())}};
      settings.keep(*std::move(measurement_result));
    }
    return {};
  };
  auto measured = measure();
  std::error_code ignored;
  fs::remove_all(*folder_result, ignored);
  return measured;
}

}  // namespace jostle::studies
