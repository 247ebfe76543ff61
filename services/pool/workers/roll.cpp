#include "services/pool/workers/roll.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <tuple>
#include <utility>

#include "services/common/process/trouble.hpp"
#include "services/wire/limits.hpp"

namespace jostle::pool {
namespace {

namespace limits = wire::limits;

constexpr std::chrono::seconds kThere{1};              // ten heartbeats
constexpr std::chrono::duration<double> kWindow{0.5};  // below that, a rate says nothing

std::string clients_text(const WorkerLine& line) {
  std::string text;
  for (const WorkerLine::Client& client : line.clients) {
    text += fmt::format("{}{} ({} {})", text.empty() ? "" : ", ", client.text, client.samples,
                        client.samples == 1 ? "sample" : "samples");
  }
  return text.empty() ? "-" : text;
}

// Characters, not bytes.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

}  // namespace

void Roll::hear(const jostle_msgs::msg::WorkerHeartbeat& heartbeat, std::uint64_t writer, TimePoint now) {
  const auto is_of_writer = [&](const auto& entry) { return entry.second.writer == writer; };
  auto found = entries_.find(heartbeat.worker());
  if (found != entries_.end() && found->second.writer != writer) return;
  if (heartbeat.capacity() == 0) {
    if (found != entries_.end()) entries_.erase(found);
    return;
  }
  if (found == entries_.end()) {
    const auto count = static_cast<std::size_t>(std::ranges::count_if(entries_, is_of_writer));
    if (count >= limits::kWorkersPerParticipant || entries_.size() >= limits::kWorkers) return;
    found = entries_.try_emplace(heartbeat.worker()).first;
    found->second.writer = writer;
    found->second.since = now;
    found->second.rollouts = heartbeat.rollouts();
  }
  Entry& entry = found->second;
  entry.heard = now;
  WorkerLine& line = entry.line;
  line.id = heartbeat.worker();
  line.name = common::shown(heartbeat.name(), limits::kShown);
  line.host = common::shown(heartbeat.host(), limits::kShown);
  line.version = common::shown(heartbeat.version(), limits::kShown);
  line.pid = heartbeat.pid();
  line.threads = heartbeat.capacity();
  line.busy = heartbeat.busy();
  line.load = heartbeat.load();
  line.rollouts = heartbeat.rollouts();
  line.clients.clear();
  for (const jostle_msgs::msg::ClientLoad& load : heartbeat.clients()) {
    if (load.samples() == 0) continue;
    const auto known = find_(load.client());
    line.clients.push_back({.id = load.client(),
                            .text = known ? known->text() : fmt::format("client {:016x}", load.client()),
                            .samples = load.samples()});
    if (line.clients.size() >= limits::kWorkers) break;
  }
}

std::vector<WorkerLine> Roll::call(TimePoint now) {
  std::erase_if(entries_, [&](const auto& entry) { return entry.second.heard + kThere < now; });
  std::vector<WorkerLine> lines;
  for (auto& [id, entry] : entries_) {
    const std::chrono::duration<double> time = now - entry.since;
    if (time >= kWindow) {
      const std::uint64_t done = entry.line.rollouts - std::min(entry.line.rollouts, entry.rollouts);
      entry.line.rate = static_cast<double>(done) / time.count();
      entry.since = now;
      entry.rollouts = entry.line.rollouts;
    }
    lines.push_back(entry.line);
  }
  std::ranges::sort(lines, {}, [](const WorkerLine& line) { return std::tie(line.host, line.name, line.id); });
  return lines;
}

std::string to_table(const std::vector<WorkerLine>& lines) {
  constexpr std::size_t kColumns = 8;
  using Row = std::array<std::string, kColumns>;
  std::vector<Row> rows{{"name", "host", "pid", "busy", "load", "rollouts/s", "version", "serving"}};
  for (const WorkerLine& line : lines) {
    rows.push_back({line.name, line.host, std::to_string(line.pid), fmt::format("{}/{}", line.busy, line.threads),
                    fmt::format("{:.1f}", line.load), line.rate ? fmt::format("{:.1f}", *line.rate) : "-", line.version,
                    clients_text(line)});
  }
  std::array<std::size_t, kColumns> widths{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < kColumns; ++i) widths[i] = std::max(widths[i], width_of(row[i]));
  }
  std::string text;
  for (const Row& row : rows) {
    std::string out;
    for (std::size_t i = 0; i < kColumns; ++i) {
      out += row[i];
      if (i + 1 < kColumns) out.append(widths[i] - width_of(row[i]) + 2, ' ');
    }
    text += out + "\n";
  }
  return text;
}

nlohmann::json to_json(const std::vector<WorkerLine>& lines) {
  nlohmann::json json = nlohmann::json::array();
  for (const WorkerLine& line : lines) {
    nlohmann::json clients = nlohmann::json::array();
    for (const WorkerLine::Client& client : line.clients) {
      clients.push_back({{"id", fmt::format("{:016x}", client.id)}, {"who", client.text}, {"samples", client.samples}});
    }
    json.push_back({{"id", fmt::format("{:016x}", line.id)},
                    {"name", line.name},
                    {"host", line.host},
                    {"pid", line.pid},
                    {"threads", line.threads},
                    {"busy", line.busy},
                    {"host_load", line.load},
                    {"rollouts", line.rollouts},
                    {"rollouts_per_second", line.rate ? nlohmann::json(*line.rate) : nlohmann::json()},
                    {"version", line.version},
                    {"clients", std::move(clients)}});
  }
  return json;
}

}  // namespace jostle::pool
