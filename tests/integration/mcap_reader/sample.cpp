// Writes a bag for check.mjs: FOLDER and mcap, raw or sqlite3.

#include <cstdio>
#include <cstring>
#include <string>
#include <utility>

#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/definitions.hpp"
#include "services/bags/format/message_files.hpp"
#include "tests/support/rover.hpp"

namespace {

using namespace jostle;

constexpr bags::Time kBegin = 1'700'000'000'000'000'000;
constexpr int kCount = 50'000;  // 5 ms apart: several chunks

std::vector<std::byte> bytes_of(const std::vector<double>& values) {
  std::vector<std::byte> bytes(4 + 8 * values.size());
  bytes[1] = std::byte{1};
  std::memcpy(bytes.data() + 4, values.data(), 8 * values.size());
  return bytes;
}

bags::Topic topic(const std::string& name, const std::string& type, const Qos& qos) {
  return {.name = name, .type = type, .qos = qos, .definition = bags::definition_of(type).value()};
}

Result<void> write(const std::string& folder, const std::string& kind) {
  auto writer_result = bags::BagWriter::create(
      folder, {.storage = kind == "sqlite3" ? bags::BagOptions::Storage::kSqlite : bags::BagOptions::Storage::kMcap,
               .compress = kind != "raw"});
  if (!writer_result) return writer_result.error();
  bags::BagWriter& writer = **writer_result;
  const auto pose_result = writer.add_topic(topic("/goal", "geometry_msgs/msg/Pose", kLatched));
  if (!pose_result) return pose_result.error();
  const auto point_result = writer.add_topic(topic("/hand", "geometry_msgs/msg/Point", kStream));
  if (!point_result) return point_result.error();
  const auto unused_result = writer.add_topic(topic("/plan", "jostle_msgs/msg/Plan", kState));
  if (!unused_result) return unused_result.error();
  // A type that is known by its .msg file only.
  auto wheel_definition = bags::MessageFiles({tests::kMessageFolder}).definition(tests::kWheelType);
  if (!wheel_definition) return wheel_definition.error();
  const auto wheel_result = writer.add_topic(
      {.name = "/wheel", .type = tests::kWheelType, .qos = kStream, .definition = std::move(wheel_definition).value()});
  if (!wheel_result) return wheel_result.error();
  const auto wheel = tests::wheel();
  if (auto ok = writer.write(*wheel_result, {.log_time = kBegin, .publish_time = kBegin, .data = wheel}); !ok)
    return ok;
  const auto pose = bytes_of({1, 2, 3, 0, 0, 0, 1});
  if (auto ok = writer.write(*pose_result, {.log_time = kBegin, .publish_time = kBegin - 7, .data = pose}); !ok) {
    return ok;
  }
  for (int i = 0; i < kCount; ++i) {
    const bags::Time time = kBegin + bags::Time{i} * 5'000'000;
    const auto point = bytes_of({static_cast<double>(i), -0.5, 1e-300});
    if (auto ok = writer.write(*point_result, {.log_time = time, .publish_time = time, .data = point}); !ok) return ok;
  }
  writer.set_note("record", {{"command", "jostle record"}, {"host", "ä"}});
  return writer.close();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const auto ok = write(argv[1], argv[2]);
  if (!ok) std::fprintf(stderr, "%s\n", ok.error().message.c_str());
  return ok ? 0 : 1;
}
