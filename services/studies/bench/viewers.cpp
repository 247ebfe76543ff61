#include <fmt/format.h>

#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <thread>

#include "services/common/process/files.hpp"
#include "services/common/process/temporary_folder.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/run_process.hpp"

namespace jostle::studies {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using nlohmann::json;

constexpr int kViewers = 2;
constexpr std::chrono::milliseconds kTick{20};

// One that looks at everything there is, on a thread of its own, until the server ends.
class Viewer {
 public:
  Viewer(std::uint16_t port, std::atomic<std::uint64_t>& samples)
      : thread_([port, &samples] {
          try {
            look(port, samples);
          } catch (const std::exception&) {  // the server ended
          }
        }) {}

 private:
  static void look(std::uint16_t port, std::atomic<std::uint64_t>& samples) {
    asio::io_context context;
    websocket::stream<tcp::socket> socket(context);
    socket.next_layer().connect({asio::ip::address_v4::loopback(), port});
    socket.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, "foxglove.websocket.v1");
    }));
    socket.handshake(fmt::format("localhost:{}", port), "/");
    std::uint32_t subscriptions = 0;
    for (beast::flat_buffer buffer;; buffer.clear()) {
      socket.read(buffer);
      if (!socket.got_text()) {
        ++samples;
        continue;
      }
      const json frame = json::parse(beast::buffers_to_string(buffer.cdata()));
      if (frame["op"] != "advertise") continue;
      json wanted{{"op", "subscribe"}, {"subscriptions", json::array()}};
      for (const json& channel : frame["channels"])
        wanted["subscriptions"].push_back({{"id", ++subscriptions}, {"channelId", channel["id"]}});
      socket.text(true);
      socket.write(asio::buffer(wanted.dump()));
    }
  }

  std::jthread thread_;
};

// The port that a run says it is shown at; nothing as long as it has not.
std::optional<std::uint16_t> port_in(const std::filesystem::path& log) {
  static const std::regex kPage("shown at http://[^:]*:([0-9]+)");
  const auto text_result = common::read_text(log);
  std::smatch page;
  if (!text_result || !std::regex_search(*text_result, page, kPage)) return {};
  return static_cast<std::uint16_t>(std::stoi(page.str(1)));
}

Result<void> measure_in(const std::filesystem::path& folder, const Settings& settings) {
  RunProcess run{.folder = folder,
                 .arguments = {common::data_file("scenes/clutter.yaml").string()},
                 .seconds = "total_seconds",
                 .domain = settings.domain,
                 .stop = settings.stop};
  RunProcess shown = run;
  shown.arguments.insert(shown.arguments.end(), {"--view", "0"});
  std::atomic<std::uint64_t> samples = 0;
  const auto watched = [&]() -> Result<Sample> {
    std::vector<std::unique_ptr<Viewer>> viewers;
    return run_once(shown, [&](common::ChildProcess& process) -> Result<void> {
      const auto port = viewers.empty() ? port_in(folder / "run.log") : std::nullopt;
      for (int i = 0; port && i < kViewers; ++i) viewers.push_back(std::make_unique<Viewer>(*port, samples));
      process.wait_for(kTick);
      return {};
    });
  };
  const auto alone = [&] {
    return run_once(run, [](common::ChildProcess& process) -> Result<void> {
      process.wait_for(kTick);
      return {};
    });
  };
  Turns turns = settings.turns();
  turns.cpu_seconds = children_cpu_seconds;
  auto result = compare({fmt::format("run with {} viewers", kViewers), watched}, {"run alone", alone}, turns);
  if (!result) return result.error();
  if (samples == 0) return Error{Code::kUnavailable, "viewers: no viewer saw a sample"};
  result->name = "viewers";
  result->unit = "s";
  result->aim = Aim{Aim::Kind::kAtMost, 1.05};
  result->details = {{"samples_per_viewer", static_cast<double>(samples) / (kViewers * (turns.repeats + 1))}};
  settings.keep(*std::move(result));
  return {};
}

}  // namespace

Result<void> measure_viewers(const Settings& settings) {
  settings.announce(1);
  auto folder_result = common::make_temporary_folder("bench-viewers");
  if (!folder_result) return folder_result.error();
  auto measured = measure_in(*folder_result, settings);
  std::error_code ignored;
  std::filesystem::remove_all(*folder_result, ignored);
  return measured;
}

}  // namespace jostle::studies
