#include "robot_bridge/ur_sim/rtde_server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace jostle::robot_bridge::ur_sim {

using ur::rtde::Packet;
using ur::rtde::PacketType;
using ur::rtde::Recipe;
using ur::rtde::Text;
using ur::rtde::Version;

class RtdeServer::Client {
 public:
  Client(RtdeServer& server, std::shared_ptr<net::Peer> peer) : server_(server), peer_(std::move(peer)) {}

  const std::shared_ptr<net::Peer>& peer() const { return peer_; }

  void take(std::span<const std::uint8_t> bytes) {
    stream_.append(bytes);
    for (;;) {
      auto packet_result = stream_.next();
      if (!packet_result) return complain(packet_result.error());
      if (!*packet_result) return;
      if (auto ok = answer(**packet_result); !ok) return complain(ok.error());
    }
  }

  void publish() {
    if (!streams_) return;
    due_ += controller().generation().cycle * frequency_;
    if (due_ < 1.0 - 1e-9) return;
    due_ -= std::floor(due_ + 1e-9);
    if (peer_->unsent() > kMostUnsent) return;  // the newest is for who reads
    std::vector<ur::rtde::Value> values;
    for (const std::string& name : outputs_.names) values.push_back(*controller().output(name));
    send(ur::rtde::pack(outputs_, values, version_));
  }

 private:
  static constexpr std::size_t kMostUnsent = 16 << 10;  // bytes
  static constexpr std::size_t kMostRecipes = 255;

  Controller& controller() const { return server_.controller_; }
  void send(const Packet& packet) { peer_->send(ur::rtde::encode(packet)); }

  // A packet that has no meaning: told, then closed, for what follows has none either.
  void complain(const Error& error) {
    send(ur::rtde::text_packet({.level = Text::Level::kError, .text = error.message, .source = "RTDE"}, version_));
    peer_->close_when_sent();
  }

  Result<void> answer(const Packet& packet) {
    switch (packet.type) {
      case PacketType::kProtocolVersion: {
        const auto version_result = ur::rtde::read_protocol_request(packet);
        if (!version_result) return version_result.error();
        const bool accepted = *version_result == static_cast<std::uint16_t>(Version::k1) ||
                              *version_result == static_cast<std::uint16_t>(controller().generation().newest_rtde);
        if (accepted) version_ = static_cast<Version>(*version_result);
        send(ur::rtde::accepted_reply(packet.type, accepted));
        return {};
      }
      case PacketType::kControllerVersion:
        send(ur::rtde::version_reply(controller().generation().version));
        return {};
      case PacketType::kOutputs:
        return agree_on_outputs(packet);
      case PacketType::kInputs:
        return agree_on_inputs(packet);
      case PacketType::kStart:
        streams_ = outputs_.id != 0;
        send(ur::rtde::accepted_reply(packet.type, streams_));
        return {};
      case PacketType::kPause:
        streams_ = false;
        send(ur::rtde::accepted_reply(packet.type, true));
        return {};
      case PacketType::kData:
        return take_inputs(packet);
      case PacketType::kText:
        return {};  // a client's own log
    }
    send(ur::rtde::text_packet({.level = Text::Level::kWarning,
                                .text = fmt::format("packet type {}: unknown", static_cast<int>(packet.type)),
                                .source = "RTDE"},
                               version_));
    return {};
  }

  Result<void> agree_on_outputs(const Packet& packet) {
    const auto request_result = ur::rtde::read_outputs_request(packet, version_);
    if (!request_result) return request_result.error();
    const double most = 1.0 / controller().generation().cycle;
    ur::rtde::RecipeReply reply{.id = 1, .types = {}};
    Recipe recipe{.id = 1, .names = request_result->names, .types = {}};
    for (const std::string& name : recipe.names) {
      const auto type = ur::rtde::output_field(name);
      reply.types.emplace_back(type ? ur::rtde::name_of(*type) : "NOT_FOUND");
      if (!type) reply.id = 0;
      recipe.types.push_back(type.value_or(ur::rtde::FieldType::kBool));
    }
    if (recipe.names.empty() || !(request_result->frequency > 0)) reply.id = 0;
    streams_ = false;
    outputs_ = reply.id == 0 ? Recipe{} : recipe;
    frequency_ = std::min(request_result->frequency, most);
    send(ur::rtde::recipe_reply(packet.type, reply, version_));
    return {};
  }

  Result<void> agree_on_inputs(const Packet& packet) {
    const auto names_result = ur::rtde::read_inputs_request(packet);
    if (!names_result) return names_result.error();
    // Without numbers there is one: the newest.
    const std::size_t others = version_ == Version::k1 ? 0 : inputs_.size();
    ur::rtde::RecipeReply reply{.id = static_cast<std::uint8_t>(others + 1), .types = {}};
    Recipe recipe{.id = reply.id, .names = *names_result, .types = {}};
    for (const std::string& name : recipe.names) {
      const auto type = ur::rtde::input_field(name);
      const auto claim = server_.claims_.find(name);
      const bool taken = claim != server_.claims_.end() && claim->second != this;
      reply.types.emplace_back(!type ? "NOT_FOUND" : taken ? "IN_USE" : ur::rtde::name_of(*type));
      if (!type || taken) reply.id = 0;
      recipe.types.push_back(type.value_or(ur::rtde::FieldType::kBool));
    }
    if (recipe.names.empty() || others >= kMostRecipes) reply.id = 0;
    if (reply.id != 0) {
      for (const std::string& name : recipe.names) server_.claims_[name] = this;
      inputs_.resize(others);
      inputs_.push_back(std::move(recipe));
    }
    send(ur::rtde::recipe_reply(packet.type, reply, version_));
    return {};
  }

  Result<void> take_inputs(const Packet& packet) {
    const std::uint8_t id = version_ == Version::k1 ? 1 : packet.payload.empty() ? 0 : packet.payload.front();
    if (id == 0 || id > inputs_.size()) {
      return Error{Code::kInvalidArgument, fmt::format("rtde U: got recipe {}, wanted 1 to {}", id, inputs_.size())};
    }
    const Recipe& recipe = inputs_[id - 1];
    auto values_result = ur::rtde::unpack(recipe, packet, version_);
    if (!values_result) return values_result.error();
    for (std::size_t i = 0; i < recipe.names.size(); ++i) controller().set_input(recipe.names[i], (*values_result)[i]);
    return {};
  }

  RtdeServer& server_;
  const std::shared_ptr<net::Peer> peer_;
  ur::rtde::PacketStream stream_;
  Version version_ = Version::k1;  // until both have agreed on 2
  Recipe outputs_;                 // id 0: none
  std::vector<Recipe> inputs_;
  double frequency_ = 0.0, due_ = 0.0;  // 1/s; samples
  bool streams_ = false;
};

RtdeServer::RtdeServer(Controller& controller) : controller_(controller) {}
RtdeServer::~RtdeServer() = default;

Result<std::unique_ptr<RtdeServer>> RtdeServer::listen(boost::asio::io_context& context, Controller& controller,
                                                       const std::string& address, std::uint16_t port) {
  std::unique_ptr<RtdeServer> rtde(new RtdeServer(controller));
  auto server_result =
      net::TcpServer::listen(context, address, port, [self = rtde.get()](const auto& peer) { self->meet(peer); });
  if (!server_result) return server_result.error();
  rtde->server_ = std::move(server_result).value();
  return rtde;
}

void RtdeServer::meet(const std::shared_ptr<net::Peer>& peer) {
  if (clients_.size() >= kMostClients) return peer->close();
  clients_.push_back(std::make_unique<Client>(*this, peer));
  Client* client = clients_.back().get();
  peer->start({.on_bytes = [client](std::span<const std::uint8_t> bytes) { client->take(bytes); },
               .on_end =
                   [this, client] {
                     std::erase_if(claims_, [&](const auto& claim) { return claim.second == client; });
                     std::erase_if(clients_, [&](const auto& one) { return one.get() == client; });
                   }});
}

void RtdeServer::publish() {
  for (const auto& client : clients_) client->publish();
}

void RtdeServer::drop_clients() {
  for (const auto& client : clients_) client->peer()->close();
}

}  // namespace jostle::robot_bridge::ur_sim
