// Spoilt requests of viewers, to what reads the text frames of their sockets.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <variant>

#include "services/tools/view/protocol.hpp"
#include "tests/fuzz/wire/mutation.hpp"

namespace jostle::tests {
namespace {

using namespace tools;

constexpr std::size_t kMostRequest = 64 << 10;  // bytes, ViewServerOptions::most_request
constexpr std::size_t kMostSaid = 1024;         // characters of a complaint beside what it repeats

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
  CLI::App app("Sends spoilt requests of viewers to what reads them.");
  long inputs = 1'000'000;
  std::uint64_t seed = 1;
  app.add_option("--inputs", inputs, "Requests")->capture_default_str();
  app.add_option("--seed", seed, "Of all random numbers")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    jostle::tests::run(inputs, seed);
    return 0;
  } catch (const std::exception& failure) {
    fmt::print(stderr, "FAILED (--seed {}): {}\n", seed, failure.what());
    return 1;
  }
}
