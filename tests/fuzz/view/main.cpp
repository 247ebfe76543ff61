// Spoilt requests of viewers, to what reads the text frames of their sockets; and spoilt frames, to the sockets.

#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <variant>

#include "services/tools/view/protocol.hpp"
#include "services/tools/view/view_server.hpp"
#include "tests/fuzz/fuzz_main.hpp"
#include "tests/fuzz/view/attacker.hpp"
#include "tests/fuzz/wire/mutation.hpp"

namespace jostle::tests {
namespace {

using namespace tools;

constexpr std::size_t kMostRequest = 64 << 10;  // bytes, ViewServerOptions::most_request
constexpr std::size_t kMostSaid = 1024;         // characters of a complaint beside what it repeats
#ifdef __SANITIZE_ADDRESS__
constexpr std::size_t kMostGrowth = 768 << 20;  // bytes: what was freed is kept from being used, 256 MiB of it
#else
constexpr std::size_t kMostGrowth = 64 << 20;  // bytes: what waits for one that never reads, and what malloc keeps
#endif

// One request of each kind, and some that are as long or as deep as a frame may be.
std::vector<std::string> requests() {
  const std::string deep = std::string(kMostRequest / 2 - 64, '[') + std::string(kMostRequest / 2 - 64, ']');
  std::string many = "0";
  while (many.size() < kMostRequest - 64) many += ",0";
  return {R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":1,"channelId":4294967295}]})",
          R"({"op":"unsubscribe","subscriptionIds":[0,1]})",
          R"({"op":"getParameters","parameterNames":["playback.time"],"id":"a"})",
          R"({"op":"setParameters","parameters":[{"name":"playback.rate","value":2.5},{"name":"x","value":true}]})",
          R"({"op":"subscribeParameterUpdates","parameterNames":[]})",
          R"({"op":"unsubscribeParameterUpdates","parameterNames":["ä"]})",
          R"({"op":"advertise","channels":[]})",
          R"({"op":"subscribe","subscriptions":[)" + deep + "]}",
          R"({"op":)" + deep + "}",
          deep,
          R"({"op":"unsubscribe","subscriptionIds":[)" + many + "]}"};
}

// Whether all of it is within the bounds that a server counts on.
void check(const ViewRequest& request) {
  const auto wanted = [](bool ok) {
    if (!ok) throw std::runtime_error("a request that should have been refused");
  };
  constexpr std::size_t kMost = 1024;
  if (const auto* subscribe = std::get_if<Subscribe>(&request)) wanted(subscribe->subscriptions.size() <= kMost);
  if (const auto* unsubscribe = std::get_if<Unsubscribe>(&request)) wanted(unsubscribe->subscriptions.size() <= kMost);
  if (const auto* set = std::get_if<SetParameters>(&request)) {
    wanted(set->values.size() <= kMost);
    for (const auto& [name, value] : set->values) wanted(value.is_number() || value.is_boolean());
    // What is set is told to others.
    (void)parameters_text(set->values, set->id);
  }
}

std::size_t resident_memory() {
  std::ifstream file("/proc/self/statm");
  std::size_t whole = 0, resident = 0;
  file >> whole >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

// To a server that plays: as many frames, of one who listens and of one who never does, while samples go out. In most
// of them the request is spoilt; the others are spoilt themselves, and end the connection as a rule.
void attack(long frames, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<std::string> small = requests(), large;
  for (const std::string& request : small) {
    if (request.size() > 1024) large.push_back(request);
  }
  std::erase_if(small, [](const std::string& request) { return request.size() > 1024; });
  auto server_result =
      ViewServer::start({.port = 0, .has_playback = true},
                        {.on_set = [](const ViewParameters& wanted) -> Result<ViewParameters> { return wanted; }});
  if (!server_result) throw std::runtime_error(server_result.error().message);
  ViewServer& server = **server_result;
  for (int i = 0; i < 4; ++i)
    server.add_channel({.name = fmt::format("/channel_{}", i), .type = "a/msg/B", .qos = {}, .definition = {}}, true);
  Attacker listener(server.port(), true), sleeper(server.port(), false);
  const std::vector<std::byte> sample(1024);
  std::size_t before = 0;
  for (long i = 0; i < frames; ++i) {
    const auto& from = random() % 200 == 0 ? large : small;
    const std::string& request = from[random() % from.size()];
    Bytes bytes(request.begin(), request.end());
    if (random() % 4 != 0) bytes = mutated(std::move(bytes), 0, random);
    Bytes frame =
        text_frame({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, static_cast<std::uint32_t>(random()));
    const bool is_spoilt = random() % 50 == 0;
    if (is_spoilt) frame = mutated(std::move(frame), 0, random);
    listener.send(frame);
    // What comes behind one that says it is longer would be taken for a part of it.
    if (is_spoilt && random() % 4 != 0) listener.hang_up();
    // A whole one: it is to stay, and to have something that waits for it.
    if (i % 64 == 0) sleeper.send(text_frame(small[random() % small.size()], static_cast<std::uint32_t>(random())));
    if (i % 16 == 0) server.send(static_cast<int>(random() % 4), i, sample);
    if (i == frames / 10) before = resident_memory();
  }
  const std::size_t after = resident_memory();
  if (after > before + kMostGrowth)
    throw std::runtime_error(fmt::format("memory grew from {} to {} MiB", before >> 20, after >> 20));
  Attacker good(server.port(), true);
  good.send(text_frame(R"({"op":"getParameters","parameterNames":[],"id":"still here"})", 1));
  if (!good.hears("still here")) throw std::runtime_error("the server answers nobody any more");
  const ViewServerCounts counts = server.counts();
  if (counts.invalid_requests == 0 || counts.viewers > 3)
    throw std::runtime_error(fmt::format("{} complaints, {} viewers", counts.invalid_requests, counts.viewers));
  fmt::print("{} frames in {} connections, {} answered with a complaint; memory from {} to {} MiB\n", frames,
             listener.connections(), counts.invalid_requests, before >> 20, after >> 20);
}

void run(long inputs, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const std::vector<std::string> seeds = requests();
  long read = 0;
  for (long i = 0; i < inputs; ++i) {
    const std::string& from = seeds[random() % seeds.size()];
    // The first ones as they are.
    Bytes bytes(from.begin(), from.end());
    if (i >= static_cast<long>(4 * seeds.size())) bytes = mutated(std::move(bytes), 0, random);
    const std::string text(bytes.begin(), bytes.end());
    const auto request_result = parse_view_request(text);
    if (request_result) {
      ++read;
      check(*request_result);
      continue;
    }
    const std::string& said = request_result.error().message;
    if (said.empty() || said.size() > text.size() + kMostSaid)
      throw std::runtime_error(fmt::format("a complaint of {} characters", said.size()));
    // Viewers are told, and their parser reads nothing but JSON.
    if (nlohmann::json::parse(status_text(ViewStatus::kError, said), nullptr, false).is_discarded())
      throw std::runtime_error("an answer that is no JSON: " + said);
  }
  if (read == 0) throw std::runtime_error("no request was read: nothing was tried");
  fmt::print("{} requests, {} of them read\n", inputs, read);
}

}  // namespace
}  // namespace jostle::tests

int main(int argc, char** argv) {
  long inputs = 1'000'000, frames = 1'000'000;
  return jostle::tests::fuzz_main(
      argc, argv, "Sends spoilt requests of viewers to what reads them, and spoilt frames to a server.",
      {{"--inputs", "Requests", &inputs}, {"--frames", "Frames", &frames}}, [&](std::uint64_t seed) {
        jostle::tests::run(inputs, seed);
        jostle::tests::attack(frames, seed);
      });
}
