#include "robot_bridge/ur_sim/script_server.hpp"

#include <utility>

#include "robot_bridge/ur/primary.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

namespace primary = ur::primary;

constexpr double kPeriod = 0.1;                // s
constexpr std::size_t kMostUnsent = 64 << 10;  // bytes: who does not read gets no more state

}  // namespace

std::optional<std::string> Scripts::next() {
  while (auto line = lines_.next()) {
    const bool begins = line->starts_with("def ") || line->starts_with("sec ");
    if (program_.empty() && !begins) {
      if (line->find_first_not_of(" \t") == std::string::npos) continue;
      return *line + "\n";
    }
    program_ += *line + "\n";
    if (*line == "end") return std::exchange(program_, {});
    if (program_.size() > kLongest) program_.clear();
  }
  return {};
}

ScriptServer::ScriptServer(Controller& controller, bool has_messages)
    : controller_(controller), has_messages_(has_messages) {}

Result<std::unique_ptr<ScriptServer>> ScriptServer::listen(boost::asio::io_context& context, Controller& controller,
                                                           const std::string& address, std::uint16_t port,
                                                           bool has_messages) {
  std::unique_ptr<ScriptServer> scripts(new ScriptServer(controller, has_messages));
  auto server_result =
      net::TcpServer::listen(context, address, port, [self = scripts.get()](const auto& peer) { self->meet(peer); });
  if (!server_result) return server_result.error();
  scripts->server_ = std::move(server_result).value();
  return scripts;
}

std::uint64_t ScriptServer::time() const { return static_cast<std::uint64_t>(controller_.time() * 1e6); }

void ScriptServer::meet(const std::shared_ptr<net::Peer>& peer) {
  clients_.push_back({.peer = peer, .scripts = {}});
  Client* client = &clients_.back();
  const auto& version = controller_.generation().version;
  peer->send(primary::version_message({.major = static_cast<std::uint8_t>(version.major),
                                       .minor = static_cast<std::uint8_t>(version.minor),
                                       .bugfix = static_cast<std::int32_t>(version.bugfix),
                                       .build = static_cast<std::int32_t>(version.build)},
                                      time()));
  peer->start({.on_bytes =
                   [this, client](std::span<const std::uint8_t> bytes) {
                     client->scripts.append(bytes);
                     while (const auto script = client->scripts.next()) obey(*client->peer, *script);
                   },
               .on_end = [this, client] { clients_.remove_if([&](const Client& one) { return &one == client; }); }});
}

void ScriptServer::obey(net::Peer& peer, const std::string& script) {
  if (controller_.generation().has_remote_control && !controller_.in_remote_control()) {
    return peer.send(primary::error_message(210, 0, "the connection is read-only: not in remote control", time()));
  }
  if (script.starts_with("stop program")) return (void)controller_.stop();
  if (script.starts_with("power on")) return (void)controller_.power_on();
  if (script.starts_with("power off")) return controller_.power_off();
  if (script.starts_with("set robotmode run")) return (void)(controller_.power_on() || controller_.brake_release());
  if (script.starts_with("set unlock protective stop")) return (void)controller_.unlock_protective_stop();
  auto program_result = parse_program(script);
  if (!program_result) return tell({Controller::Event::Kind::kError, program_result.error().message});
  controller_.run(std::move(program_result).value());
}

void ScriptServer::publish() {
  const double now = controller_.time();
  if (now < next_ && next_ - now <= kPeriod) return;
  next_ = now + kPeriod;
  if (clients_.empty()) return;
  primary::State state{.time = time(),
                       .robot_mode = controller_.robot_mode(),
                       .safety_mode = controller_.safety_mode(),
                       .is_program_running = controller_.is_running(),
                       .is_program_paused = controller_.runtime_state() == ur::RuntimeState::kPaused,
                       .kinematics = controller_.kinematics};
  state.q = std::get<Joints>(*controller_.output("actual_q"));
  state.qd = std::get<Joints>(*controller_.output("actual_qd"));
  state.q_target = std::get<Joints>(*controller_.output("target_q"));
  const Bytes packet = primary::state_packet(state);
  for (const Client& client : clients_) {
    if (client.peer->unsent() < kMostUnsent) client.peer->send(packet);
  }
}

void ScriptServer::tell(const Controller::Event& event) {
  if (!has_messages_) return;
  using Kind = Controller::Event::Kind;
  const Bytes message =
      event.kind == Kind::kProgramStarted   ? primary::key_message("PROGRAM_XXX_STARTED", event.text, time())
      : event.kind == Kind::kProgramStopped ? primary::key_message("PROGRAM_XXX_STOPPED", event.text, time())
                                            : primary::error_message(0, 0, event.text, time());
  for (const Client& client : clients_) client.peer->send(message);
}

void ScriptServer::drop_clients() {
  for (const Client& client : clients_) client.peer->close();
}

}  // namespace jostle::robot_bridge::ur_sim
