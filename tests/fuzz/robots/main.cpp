// Spoilt input on the wires of an arm: RTDE, primary interface, dashboard, gripper, external control. To the simulated
// controller over sockets, and to what our clients read with. No crash, no hang, no growth; the controller still serves
// a good client in the end. Best under ASan and UBSan: cmake -B build-asan -DJOSTLE_SANITIZE=address.

#include <fmt/format.h>
#include <malloc.h>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <random>

#include "robot_bridge/robotiq/gripper.hpp"
#include "robot_bridge/ur/control_program.hpp"
#include "robot_bridge/ur/primary.hpp"
#include "robot_bridge/ur/rtde.hpp"
#include "robot_bridge/ur_sim/dashboard_server.hpp"
#include "robot_bridge/ur_sim/external_control.hpp"
#include "robot_bridge/ur_sim/gripper_server.hpp"
#include "robot_bridge/ur_sim/rtde_server.hpp"
#include "robot_bridge/ur_sim/script_server.hpp"
#include "tests/support/exact_plant.hpp"

namespace jostle::fuzz {
namespace {

namespace asio = boost::asio;
namespace rtde = robot_bridge::ur::rtde;
namespace primary = robot_bridge::ur::primary;
namespace ur_sim = robot_bridge::ur_sim;
using asio::ip::tcp;

constexpr unsigned kPatience = 60;  // s, for one input
#ifdef __SANITIZE_ADDRESS__
constexpr std::size_t kMostGrowth = std::size_t{1} << 30;  // bytes: what was freed stays for a while, to be found used
#else
constexpr std::size_t kMostGrowth = 64 << 20;  // bytes
#endif
constexpr std::uint64_t kWarmUp = 1000;

std::uint64_t seed = 1, number = 0;

[[noreturn]] void hang(int) {
  std::fprintf(stderr, "hangs: --seed %llu, input %llu\n", static_cast<unsigned long long>(seed),
               static_cast<unsigned long long>(number));
  _exit(1);
}

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

class Dice {
 public:
  explicit Dice(std::uint64_t number_of_run) : random_(number_of_run) {}
  std::size_t operator()(std::size_t sides) {
    return std::uniform_int_distribution<std::size_t>(0, sides - 1)(random_);
  }

 private:
  std::mt19937_64 random_;
};

// One of the good messages, spoilt; sometimes left as it is.
Bytes spoil(const std::vector<Bytes>& corpus, Dice& dice) {
  Bytes bytes = corpus[dice(corpus.size())];
  for (std::size_t i = dice(4); i > 0 && !bytes.empty(); --i) {
    const std::size_t at = dice(bytes.size());
    switch (dice(6)) {
      case 0:
        bytes[at] = static_cast<std::uint8_t>(dice(256));
        break;
      case 1:
        bytes[at] ^= static_cast<std::uint8_t>(1u << dice(8));
        break;
      case 2:
        bytes.resize(at);
        break;
      case 3:
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), dice(64), static_cast<std::uint8_t>(dice(256)));
        break;
      case 4: {
        const Bytes& other = corpus[dice(corpus.size())];
        bytes.insert(bytes.end(), other.begin(), other.end());
        break;
      }
      default:
        bytes[at] = dice(2) == 0 ? 0xFF : 0x00;
    }
  }
  return bytes;
}

// Everything that serves, on ports of its own choice.
class System {
 public:
  System() {
    controller_.opening_rate = [this](double dt) { return gripper_.opening_rate(dt); };
    controller_.on_event = [this](const auto& event) {
      if (scripts_) scripts_->tell(event);
    };
    take(ur_sim::RtdeServer::listen(context_, controller_, "127.0.0.1", 0), rtde_);
    take(ur_sim::ScriptServer::listen(context_, controller_, "127.0.0.1", 0, true), scripts_);
    take(ur_sim::serve_dashboard(context_, controller_, "127.0.0.1", 0), dashboard_);
    take(ur_sim::serve_gripper(context_, gripper_, "127.0.0.1", 0), robotiq_);
  }

  void let(int cycles) {
    for (int i = 0; i < cycles; ++i) {
      context_.restart();
      context_.poll();
      external_.tick();
      if (!controller_.tick()) std::abort();
      rtde_->publish();
      scripts_->publish();
    }
  }

  asio::io_context context_{1};
  tests::ExactPlant plant_;
  ur_sim::Controller controller_{plant_, ur_sim::Generation::e_series()};
  ur_sim::Gripper gripper_{plant_};
  ur_sim::ExternalControl external_{context_, controller_};
  std::unique_ptr<ur_sim::RtdeServer> rtde_;
  std::unique_ptr<ur_sim::ScriptServer> scripts_;
  std::unique_ptr<robot_bridge::net::TcpServer> dashboard_, robotiq_;

 private:
  template <class Made, class Place>
  static void take(Made made, Place& place) {
    if (!made) throw std::runtime_error(made.error().message);
    place = std::move(made).value();
  }
};

// A client that says spoilt things, and reads and forgets what comes back.
class Rascal {
 public:
  Rascal(System& system, std::uint16_t port, std::vector<Bytes> corpus)
      : system_(system), place_(asio::ip::address_v4::loopback(), port), corpus_(std::move(corpus)) {}

  void speak(Dice& dice) {
    if (!socket_.is_open() || dice(500) == 0) connect();
    boost::system::error_code code;
    const Bytes bytes = spoil(corpus_, dice);
    socket_.write_some(asio::buffer(bytes), code);
    if (code && code != asio::error::would_block) socket_.close(code);
    system_.context_.restart();
    system_.context_.poll();
    std::array<std::uint8_t, 65536> room;
    while (socket_.is_open()) {
      socket_.read_some(asio::buffer(room), code);
      if (code == asio::error::would_block) break;
      if (code) socket_.close(code);
    }
  }

 private:
  void connect() {
    boost::system::error_code ignored;
    socket_.close(ignored);
    socket_ = tcp::socket(system_.context_);
    socket_.connect(place_);
    socket_.non_blocking(true);
  }

  System& system_;
  const tcp::endpoint place_;
  const std::vector<Bytes> corpus_;
  tcp::socket socket_{system_.context_};
};

std::vector<Bytes> rtde_requests() {
  std::vector<Bytes> corpus;
  for (const auto& packet : {rtde::protocol_request(2), rtde::version_request(),
                             rtde::outputs_request(125, {"timestamp", "actual_q", "robot_mode"}),
                             rtde::inputs_request({"speed_slider_mask", "speed_slider_fraction"}),
                             rtde::inputs_request({"input_int_register_24", "input_double_register_24"}),
                             rtde::start_request(), rtde::pause_request(),
                             rtde::text_packet({.level = rtde::Text::Level::kInfo, .text = "hello", .source = "fuzz"}),
                             rtde::Packet{.type = rtde::PacketType::kData, .payload = Bytes(13, 1)}}) {
    corpus.push_back(rtde::encode(packet));
  }
  return corpus;
}

std::vector<Bytes> scripts() {
  return {bytes_of(robot_bridge::ur::control_program(0.002)),
          bytes_of("def go():\n  movej([0, -1.5, 1.5, -1.5, -1.5, 0], a=1.4, v=1.05)\n  sleep(0.1)\n  stopj(2)\nend\n"),
          bytes_of("movel(p[-0.4, -0.2, 0.3, 0, 3.1, 0], a=1, v=0.2)\n"),
          bytes_of("speedj([0.1, 0, 0, 0, 0, 0], 1, 0.5)\n"),
          bytes_of("def x():\n  socket_open(\"127.0.0.1\", 1, \"trajectory_socket\")\n  socket_open(\"127.0.0.1\", 2, "
                   "\"reverse_socket\")\nend\n"),
          bytes_of("power on\n"),
          bytes_of("set robotmode run\n"),
          bytes_of("stop program\n")};
}

std::vector<Bytes> dashboard_commands() {
  std::vector<Bytes> corpus;
  for (const char* command : {"power on", "brake release", "robotmode", "safetymode", "play", "stop", "pause",
                              "load x.urp", "popup hello", "close safety popup", "unlock protective stop",
                              "restart safety", "PolyscopeVersion", "is in remote control", "power off", "quit"}) {
    corpus.push_back(bytes_of(std::string(command) + "\n"));
  }
  return corpus;
}

std::vector<Bytes> gripper_requests() {
  return {bytes_of("SET ACT 1\n"), bytes_of("SET ACT 0\n"), bytes_of("SET POS 100 SPE 255 FOR 10 GTO 1\n"),
          bytes_of("GET POS\n"),   bytes_of("GET OBJ\n"),   bytes_of("GET STA\n"),
          bytes_of("SET ATR 1\n")};
}

// What a client reads of RTDE: packets, replies, samples.
void read_as_rtde_client(std::span<const std::uint8_t> bytes) {
  static const rtde::Recipe recipe{
      .id = 1,
      .names = {"timestamp", "actual_q", "robot_mode"},
      .types = {rtde::FieldType::kDouble, rtde::FieldType::kVector6d, rtde::FieldType::kInt32}};
  rtde::PacketStream stream;
  stream.append(bytes);
  for (;;) {
    const auto packet = stream.next();
    if (!packet || !*packet) return;
    (void)rtde::unpack(recipe, **packet);
    (void)rtde::read_accepted(**packet);
    (void)rtde::read_version(**packet);
    (void)rtde::read_text(**packet);
    if (const auto reply = rtde::read_recipe_reply(**packet)) (void)rtde::agree(recipe.names, *reply);
  }
}

void read_as_primary_client(std::span<const std::uint8_t> bytes) {
  primary::PacketStream stream;
  stream.append(bytes);
  for (;;) {
    const auto packet = stream.next();
    if (!packet || !*packet) return;
    (void)primary::read_kinematics(**packet);
  }
}

void read_as_gripper_client(std::span<const std::uint8_t> bytes) {
  const std::string line(bytes.begin(), bytes.end());
  for (const char* variable : {"POS", "OBJ", "FLT", "STA"}) (void)robot_bridge::robotiq::read_answer(variable, line);
}

std::vector<Bytes> rtde_answers() {
  std::vector<Bytes> corpus;
  const rtde::Recipe recipe{.id = 1,
                            .names = {"timestamp", "actual_q", "robot_mode"},
                            .types = {rtde::FieldType::kDouble, rtde::FieldType::kVector6d, rtde::FieldType::kInt32}};
  for (const auto& packet :
       {rtde::accepted_reply(rtde::PacketType::kProtocolVersion, true), rtde::version_reply({3, 15, 8, 1}),
        rtde::recipe_reply(rtde::PacketType::kOutputs, {.id = 1, .types = {"DOUBLE", "VECTOR6D", "INT32"}}),
        rtde::text_packet({.level = rtde::Text::Level::kError, .text = "no", .source = "RTDE"}),
        rtde::pack(recipe, {1.0, std::array<double, 6>{1, 2, 3, 4, 5, 6}, std::int32_t{7}})}) {
    corpus.push_back(rtde::encode(packet));
  }
  return corpus;
}

std::vector<Bytes> primary_packets() {
  return {primary::version_message({}, 1), primary::key_message("PROGRAM_XXX_STARTED", "go", 2),
          primary::error_message(210, 0, "read-only", 3), primary::text_message("hello", 4),
          primary::state_packet({.kinematics = robot_bridge::ur::Dh::ur5()})};
}

std::size_t resident() {
  std::ifstream statm("/proc/self/statm");
  std::size_t all = 0, pages = 0;
  statm >> all >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

int run(std::uint64_t inputs) {
  System system;
  Dice dice(seed);
  // Ports of servers that choose their own.
  std::vector<std::pair<std::string, std::function<void()>>> wires;
  std::vector<std::unique_ptr<Rascal>> rascals;
  const auto over_socket = [&](const char* name, std::uint16_t port, std::vector<Bytes> corpus) {
    rascals.push_back(std::make_unique<Rascal>(system, port, std::move(corpus)));
    wires.emplace_back(name, [&dice, rascal = rascals.back().get()] { rascal->speak(dice); });
  };
  over_socket("RTDE to the controller", system.rtde_->port(), rtde_requests());
  over_socket("programs to the controller", system.scripts_->port(), scripts());
  over_socket("dashboard", system.dashboard_->port(), dashboard_commands());
  over_socket("gripper", system.robotiq_->port(), gripper_requests());
  const auto in_place = [&](const char* name, std::vector<Bytes> corpus, void (*read)(std::span<const std::uint8_t>)) {
    wires.emplace_back(name, [&dice, read, good = std::move(corpus)] { read(spoil(good, dice)); });
  };
  in_place("RTDE to a client", rtde_answers(), read_as_rtde_client);
  in_place("primary to a client", primary_packets(), read_as_primary_client);
  in_place("gripper to a client", {bytes_of("POS 100"), bytes_of("OBJ 3"), bytes_of("FLT 0"), bytes_of("STA 3")},
           read_as_gripper_client);
  std::size_t begin = 0;
  for (const auto& [name, say] : wires) {
    for (std::uint64_t i = 0; i < inputs; ++i) {
      ++number;
      alarm(kPatience);
      say();
      if (i % 20 == 0) system.let(2);
      if (number == kWarmUp) begin = resident();
    }
    fmt::print("{:27} {} inputs\n", name, inputs);
    std::fflush(stdout);
  }
  alarm(0);
  malloc_trim(0);
  if (begin > 0 && resident() > begin + kMostGrowth) {
    fmt::print("memory grew from {} to {} bytes\n", begin, resident());
    return 1;
  }
  // And a good client is served.
  rascals.clear();
  system.let(20);
  tcp::socket good(system.context_);
  good.connect({asio::ip::address_v4::loopback(), system.dashboard_->port()});
  asio::write(good, asio::buffer(std::string("robotmode\n")));
  system.let(20);
  std::array<char, 256> room;
  good.non_blocking(true);
  std::string heard;
  boost::system::error_code code;
  for (int i = 0; i < 100 && heard.find("Robotmode: ") == heard.npos; ++i) {
    system.let(1);
    heard.append(room.data(), good.read_some(asio::buffer(room), code));
  }
  if (heard.find("Robotmode: ") == heard.npos) {
    fmt::print("a good client got '{}'\n", heard);
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace jostle::fuzz

int main(int argc, char** argv) {
  using namespace jostle::fuzz;
  CLI::App app("Sends spoilt input over every wire of an arm.", "jostle_fuzz_robots");
  std::uint64_t inputs = 20'000;
  app.add_option("--inputs", inputs, "Of each wire and side")->capture_default_str();
  app.add_option("--seed", seed, "Of all random numbers")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  signal(SIGALRM, hang);
  signal(SIGPIPE, SIG_IGN);
  return run(inputs);
}
