#include "perception/natnet/server.hpp"

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstring>
#include <map>
#include <thread>
#include <utility>

namespace jostle::perception::natnet {
namespace {

using boost::asio::ip::udp;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kSilent{10};  // a client that is gone

}  // namespace

class Server::Impl {
 public:
  Impl(Options options, std::vector<Model> models) : options_(std::move(options)), models_(std::move(models)) {}

  ~Impl() {
    context_.stop();
    thread_ = {};  // joins
  }

  Result<void> listen() {
    boost::system::error_code error;
    const auto address = boost::asio::ip::make_address_v4(options_.address, error);
    if (!error) socket_.open(udp::v4(), error);
    if (!error) socket_.bind({address, options_.command_port}, error);
    if (!error && options_.multicast)
      socket_.set_option(boost::asio::ip::multicast::outbound_interface(address), error);
    if (!error && options_.multicast)
      group_ = {boost::asio::ip::make_address(options_.group, error), options_.data_port};
    if (error) {
      return Error{Code::kUnavailable,
                   fmt::format("natnet: UDP port {}:{}: {}", options_.address, options_.command_port, error.message())};
    }
    receive();
    thread_ = std::jthread([this] { context_.run(); });
    return {};
  }

  void publish(Frame frame, std::chrono::nanoseconds latency) {
    frame.mid_exposure = frame.received = ticks();
    const auto due = Clock::now() + std::chrono::duration_cast<Clock::duration>(latency);
    boost::asio::post(context_, [this, due, frame = std::move(frame)]() mutable {
      if (due <= Clock::now()) return send(std::move(frame));
      auto timer = std::make_unique<boost::asio::steady_timer>(context_, due);
      boost::asio::steady_timer& waiting = *timer;
      waiting.async_wait(
          [this, timer = std::move(timer), frame = std::move(frame)](const boost::system::error_code& error) mutable {
            if (!error) send(std::move(frame));
          });
    });
  }

  std::size_t clients() const { return count_; }

 private:
  struct Peer {
    Version version;
    Clock::time_point heard;
  };

  std::uint64_t ticks() const {
    const std::chrono::duration<double> time = Clock::now() - start_;
    return static_cast<std::uint64_t>(time.count() * static_cast<double>(kClock));
  }

  void receive() {
    socket_.async_receive_from(boost::asio::buffer(room_), from_,
                               [this](const boost::system::error_code& error, std::size_t size) {
                                 if (error == boost::asio::error::operation_aborted) return;
                                 // Errors are those of clients that are gone.
                                 if (!error) answer(std::span(room_).first(size));
                                 receive();
                               });
  }

  void reply(MessageId id, Bytes payload) {
    boost::system::error_code ignored;
    socket_.send_to(boost::asio::buffer(encode(Message{id, std::move(payload)})), from_, 0, ignored);
  }

  void answer(std::span<const std::uint8_t> datagram) {
    const auto message = decode(datagram);
    if (!message) return;
    const auto found = peers_.find(from_);
    if (found != peers_.end()) found->second.heard = Clock::now();
    const Version version = found != peers_.end() ? found->second.version : options_.version;
    switch (message->id) {
      case MessageId::kConnect:
        forget_silent();
        if (peers_.size() >= kMostClients) return;
        peers_.insert_or_assign(from_, Peer{version, Clock::now()});
        count_ = peers_.size();
        [[fallthrough]];
      case MessageId::kDiscovery:
        return reply(MessageId::kServerInfo, info());
      case MessageId::kRequest:
        return respond(*message);
      case MessageId::kModelRequest:
        return reply(MessageId::kModels, encode(models_, version));
      case MessageId::kEcho: {
        if (message->payload.size() != 8) return;
        LittleEndianWriter out;
        Bytes payload = message->payload;
        const Bytes now = out.put(ticks()).take();
        payload.insert(payload.end(), now.begin(), now.end());
        return reply(MessageId::kEchoReply, std::move(payload));
      }
      case MessageId::kDisconnect:
        peers_.erase(from_);
        count_ = peers_.size();
        return;
      case MessageId::kKeepAlive:
        return;
      default:
        return reply(MessageId::kUnrecognised, {});
    }
  }

  Bytes info() const {
    ServerInfo info{.name = "jostle",
                    .app_version = {},
                    .natnet_version = {options_.version.major, options_.version.minor, 0, 0},
                    .clock_hz = kClock,
                    .data_port = options_.data_port,
                    .multicast = options_.multicast,
                    .group = {}};
    if (options_.multicast) info.group = group_.address().to_v4().to_bytes();
    return encode(info);
  }

  void respond(const Message& request) {
    LittleEndianWriter out;
    const std::string words(request.payload.begin(), request.payload.end());
    const auto version = requested_bitstream(request.payload);
    const auto found = peers_.find(from_);
    if (version && version->is_known() && found != peers_.end() && !options_.multicast) {
      found->second.version = *version;
      out.put(std::int32_t{0});
    } else if (words.starts_with("FrameRate")) {
      out.put(options_.frame_rate);
    } else {
      return reply(MessageId::kUnrecognised, {});
    }
    reply(MessageId::kResponse, out.take());
  }

  void forget_silent() {
    std::erase_if(peers_, [](const auto& entry) { return Clock::now() - entry.second.heard > kSilent; });
    count_ = peers_.size();
  }

  void send(Frame frame) {
    frame.number = ++number_;
    frame.sent = ticks();
    forget_silent();
    boost::system::error_code ignored;
    if (options_.multicast) {
      const Bytes bytes = encode(Message{MessageId::kFrame, encode(frame, options_.version)});
      socket_.send_to(boost::asio::buffer(bytes), group_, 0, ignored);
      return;
    }
    std::map<Version, Bytes> bytes;
    for (const auto& [peer, state] : peers_) {
      Bytes& own = bytes[state.version];
      if (own.empty()) own = encode(Message{MessageId::kFrame, encode(frame, state.version)});
      socket_.send_to(boost::asio::buffer(own), peer, 0, ignored);
    }
  }

  const Options options_;
  const std::vector<Model> models_;
  const Clock::time_point start_ = Clock::now();
  boost::asio::io_context context_{1};
  udp::socket socket_{context_};
  udp::endpoint from_, group_;
  std::array<std::uint8_t, kLargest> room_;
  std::map<udp::endpoint, Peer> peers_;
  std::atomic<std::size_t> count_{0};
  std::int32_t number_ = 0;
  std::jthread thread_;  // last: it uses all of the above
};

Result<std::unique_ptr<Server>> Server::listen(Options options, std::vector<Model> models) {
  auto impl = std::make_unique<Impl>(std::move(options), std::move(models));
  if (auto ok = impl->listen(); !ok) return ok.error();
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;
void Server::publish(Frame frame, std::chrono::nanoseconds latency) { impl_->publish(std::move(frame), latency); }
std::size_t Server::clients() const { return impl_->clients(); }

}  // namespace jostle::perception::natnet
