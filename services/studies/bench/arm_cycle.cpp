// How soon a controller of an arm has its answer: our client against a loop that does nothing but answer.

#include <fmt/format.h>
#include <unistd.h>
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "robot_bridge/net/tcp_client.hpp"
#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/ur/planar_arm.hpp"
#include "robot_bridge/ur/rtde.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using namespace std::chrono_literals;
namespace net = robot_bridge::net;
namespace ur = robot_bridge::ur;
namespace rtde = robot_bridge::ur::rtde;
using boost::asio::ip::tcp;
using Clock = net::Clock;

constexpr auto kReady = 30s;     // for an arm to be switched on
constexpr double kTurn = 4.0;    // s of one side, each time
constexpr double kPush = 0.02;   // m/s, to and fro
constexpr double kStroke = 0.5;  // s
constexpr double kMost = 500.0;  // samples/s; a controller gives what it has

// What came of one side.
struct Answers {
  std::vector<double> delays;            // us, from a sample to the next command
  std::uint64_t cycles = 0, missed = 0;  // a sample is missed that the next one follows unanswered
};

// A Relay stands between a controller's RTDE server and one client at a time, and looks at the clock.
//
// Threads  its own, and those that call.
class Relay {
 public:
  static Result<std::unique_ptr<Relay>> start(const std::string& address) {
    std::unique_ptr<Relay> relay(new Relay(address));
    auto server_result = net::TcpServer::listen(relay->context_, address, 0,
                                                [self = relay.get()](const auto& peer) { self->welcome(peer); });
    if (!server_result) return server_result.error();
    relay->server_ = std::move(server_result).value();
    relay->port_ = relay->server_->port();
    relay->thread_ = std::jthread([self = relay.get()] { self->context_.run(); });
    return relay;
  }
  ~Relay() { context_.stop(); }

  std::uint16_t port() const { return port_; }

  // What came since the last call.
  Answers take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(answers_, {});
  }

 private:
  explicit Relay(std::string address) : address_(std::move(address)) {}

  void welcome(const std::shared_ptr<net::Peer>& client) {
    if (controller_) controller_->close();
    tcp::socket socket(context_);
    boost::system::error_code error;
    socket.connect(tcp::endpoint(boost::asio::ip::make_address(address_), rtde::kPort), error);
    if (error) return client->close();
    socket.set_option(tcp::no_delay(true), error);
    controller_ = std::make_shared<net::Peer>(std::move(socket));
    samples_ = commands_ = {};
    pending_.reset();
    controller_->start({.on_bytes =
                            [this, client](std::span<const std::uint8_t> bytes) {
                              if (count_data(samples_, bytes) > 0) note_sample();
                              client->send(bytes);
                            },
                        .on_end = [client] { client->close(); }});
    client->start({.on_bytes =
                       [this, controller = controller_](std::span<const std::uint8_t> bytes) {
                         if (count_data(commands_, bytes) > 0) note_command();
                         controller->send(bytes);
                       },
                   .on_end = [controller = controller_] { controller->close(); }});
  }

  static int count_data(rtde::PacketStream& stream, std::span<const std::uint8_t> bytes) {
    stream.append(bytes);
    int found = 0;
    for (auto packet = stream.next(); packet && *packet; packet = stream.next())
      found += (*packet)->type == rtde::PacketType::kData ? 1 : 0;
    return found;
  }

  void note_sample() {
    const std::lock_guard lock(mutex_);
    ++answers_.cycles;
    if (pending_) ++answers_.missed;
    pending_ = Clock::now();
  }

  void note_command() {
    const std::lock_guard lock(mutex_);
    if (pending_) answers_.delays.push_back(1e6 * seconds_since(*pending_));
    pending_.reset();
  }

  const std::string address_;
  boost::asio::io_context context_{1};
  std::unique_ptr<net::TcpServer> server_;
  std::uint16_t port_ = 0;
  std::shared_ptr<net::Peer> controller_;
  rtde::PacketStream samples_, commands_;
  std::optional<Clock::time_point> pending_;  // when the sample came that waits for its command

  std::mutex mutex_;  // guards answers_ and pending_
  Answers answers_;
  std::jthread thread_;  // last: it uses all of the above
};

// The arm moves to and fro, as in a run.
Result<void> move_for(ur::PlanarArm& arm, double seconds, std::stop_token stop) {
  const auto begin = Clock::now();
  double way = kPush;
  std::uint64_t motion = 0;
  while (seconds_since(begin) < seconds) {
    const ur::PlanarArm::Report& report = arm.report();
    if (!report.is_ready) return Error{Code::kUnavailable, "arm-cycle: " + arm.trouble()};
    if (report.over >= motion) motion = arm.move({.x = std::exchange(way, -way), .y = 0.0, .rotation = 0.0}, kStroke);
    if (!common::pause_until(Clock::now() + 20ms, stop)) return Error{Code::kCancelled, "interrupted"};
  }
  arm.halt();
  return {};
}

Result<void> use_client(const std::string& address, Relay& relay, std::stop_token stop) {
  ur::PlanarArmOptions options;
  options.host = address;
  options.rtde_port = relay.port();
  options.watchdog = 1.0;
  ur::PlanarArm arm(options);
  const auto deadline = Clock::now() + kReady;
  while (!arm.report().is_ready) {
    if (Clock::now() > deadline) return Error{Code::kUnavailable, "arm-cycle: not ready: " + arm.trouble()};
    if (!common::pause_until(Clock::now() + 20ms, stop)) return Error{Code::kCancelled, "interrupted"};
  }
  relay.take();  // getting ready is no motion
  return move_for(arm, kTurn, stop);
}

// Reads a packet, and writes one: the least that a client can do.
Result<void> use_bare_loop(const std::string& address, Relay& relay, std::stop_token stop) {
  auto tcp_result = net::TcpClient::connect(address, relay.port(), Clock::now() + 5s);
  if (!tcp_result) return tcp_result.error();
  net::TcpClient& tcp = *tcp_result;
  rtde::PacketStream stream;
  std::array<std::uint8_t, 4096> room;
  const auto next = [&](Clock::time_point deadline) -> Result<rtde::Packet> {
    for (;;) {
      auto packet = stream.next();
      if (!packet) return packet.error();
      if (*packet) return **std::move(packet);
      auto bytes = tcp.read(room, deadline);
      if (!bytes) return bytes.error();
      stream.append(*bytes);
    }
  };
  rtde::Recipe inputs;
  const std::vector<std::string> input_names{"input_int_register_24"};
  for (const rtde::Packet& request :
       {rtde::protocol_request(2), rtde::outputs_request(kMost, {"timestamp", "actual_q", "actual_qd"}),
        rtde::inputs_request(input_names), rtde::start_request()}) {
    if (auto ok = tcp.write(rtde::encode(request), Clock::now() + 1s); !ok) return ok;
    auto answer = next(Clock::now() + 5s);
    if (!answer) return answer.error();
    if (request.type != rtde::PacketType::kInputs) continue;
    auto reply = rtde::read_recipe_reply(*answer);
    if (!reply) return reply.error();
    auto recipe = rtde::agree(input_names, *reply);
    if (!recipe) return recipe.error();
    inputs = std::move(recipe).value();
  }
  const Bytes command = rtde::encode(rtde::pack(inputs, {std::int32_t{0}}));
  relay.take();
  for (const auto begin = Clock::now(); seconds_since(begin) < kTurn;) {
    auto packet = next(Clock::now() + 2s);
    if (!packet) return packet.error();
    if (packet->type != rtde::PacketType::kData) continue;
    if (auto ok = tcp.write(command, Clock::now() + 1s); !ok) return ok;
    if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
  }
  return {};
}

// One side, over all of its turns.
class Tally {
 public:
  using Use = Result<void> (*)(const std::string& address, Relay& relay, std::stop_token stop);

  Result<Sample> run(Use use, const std::string& address, Relay& relay, std::stop_token stop) {
    if (auto ok = use(address, relay, std::move(stop)); !ok) return ok.error();
    Answers answers = relay.take();
    if (answers.delays.empty()) return Error{Code::kUnavailable, "arm-cycle: no command came"};
    const Sample sample{.value = common::median(answers.delays), .hash = {}};
    if (std::exchange(warm_, true)) {
      delays_.insert(delays_.end(), answers.delays.begin(), answers.delays.end());
      cycles_ += answers.cycles;
      missed_ += answers.missed;
    }
    return sample;
  }

  void report(const std::string& side, Measurement& measurement) const {
    const double cycles = std::max(static_cast<double>(cycles_), 1.0);
    measurement.details.insert(measurement.details.end(),
                               {{side + "_median_us", common::median(delays_)},
                                {side + "_p999_us", common::quantile(delays_, 0.999)},
                                {side + "_cycles", static_cast<double>(cycles_)},
                                {side + "_missed_percent", 100.0 * static_cast<double>(missed_) / cycles}});
  }

 private:
  bool warm_ = false;  // the first turn does not count
  std::vector<double> delays_;
  std::uint64_t cycles_ = 0, missed_ = 0;
};

Result<Measurement> measure_generation(const std::string& generation, int rate, const Settings& settings) {
  const std::string address = fmt::format("127.0.4.{}", settings.domain + 1);
  Helpers helpers(settings.domain, {});
  if (auto ok = helpers.start("jostle_ur_sim",
                              {common::data_file("scenes/clutter.yaml").string(), "--address", address, "--controller",
                               generation, "--no-eyes", "--die-with-parent", std::to_string(getpid())});
      !ok)
    return ok.error();
  const auto deadline = Clock::now() + kReady;
  while (!net::TcpClient::connect(address, rtde::kPort, Clock::now() + 1s)) {
    const std::string casualty = helpers.casualty();
    if (Clock::now() > deadline || !casualty.empty())
      return Error{Code::kUnavailable, "arm-cycle: no controller " + casualty};
    if (!common::pause_until(Clock::now() + 50ms, settings.stop)) return Error{Code::kCancelled, "interrupted"};
  }
  auto relay_result = Relay::start(address);
  if (!relay_result) return relay_result.error();
  Tally client, bare;
  auto result = compare({"client", [&] { return client.run(use_client, address, **relay_result, settings.stop); }},
                        {"bare loop", [&] { return bare.run(use_bare_loop, address, **relay_result, settings.stop); }},
                        settings.turns());
  if (!result) return result.error();
  result->name = fmt::format("arm-cycle/{}-hz", rate);
  result->unit = "us";
  client.report("client", *result);
  bare.report("bare", *result);
  return result;
}

}  // namespace

Result<void> measure_arm_cycle(const Settings& settings) {
  const std::pair<const char*, int> generations[] = {{"cb3", 125}, {"e-series", 500}};
  settings.announce(static_cast<int>(std::size(generations)));
  for (const auto& [generation, rate] : generations) {
    auto result = measure_generation(generation, rate, settings);
    if (!result) return result.error();
    settings.keep(*std::move(result));
  }
  return {};
}

}  // namespace jostle::studies
