#include "perception/natnet/client.hpp"

#include <fmt/format.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

namespace jostle::perception::natnet {
namespace {

using boost::asio::ip::udp;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kTick = 100ms;
constexpr auto kAskAgain = 500ms;  // what was not answered
constexpr auto kKeepAlive = 1s;
constexpr auto kNoFrames = 2s;  // worth a word
constexpr auto kGone = 5s;      // without a word of a server
constexpr std::size_t kEchoes = 16;

// How a server's ticks and this host's clock go together, as one echo says.
struct Echo {
  Clock::time_point middle;
  std::uint64_t ticks = 0;
  Clock::duration round_trip{};
};

}  // namespace

class Client::Impl {
 public:
  Impl(Options options, std::function<void(const Seen&)> on_seen)
      : options_(std::move(options)), on_seen_(std::move(on_seen)) {}

  ~Impl() {
    context_.stop();
    thread_ = {};  // joins
    if (info_) send(MessageId::kDisconnect, {});
  }

  Result<void> start() {
    boost::system::error_code error;
    udp::resolver resolver(context_);
    const auto found = resolver.resolve(udp::v4(), options_.host, std::to_string(options_.command_port), error);
    if (!error) server_ = *found.begin();
    if (!error) command_.socket.open(udp::v4(), error);
    if (!error) command_.socket.bind({udp::v4(), 0}, error);
    if (error) {
      return Error{Code::kUnavailable, fmt::format("natnet: {}: {}", place(), error.message())};
    }
    say(fmt::format("{}: no answer so far; is its program running, and does it stream?", place()));
    receive(command_);
    tick();
    thread_ = std::jthread([this] { context_.run(); });
    return {};
  }

  std::string trouble() const {
    const std::lock_guard lock(mutex_);
    return trouble_;
  }
  Counts counts() const {
    const std::lock_guard lock(mutex_);
    return counts_;
  }

 private:
  struct Port {
    udp::socket socket;
    udp::endpoint from;
    std::array<std::uint8_t, kLargest> room;
  };

  std::string place() const { return fmt::format("{}:{}", options_.host, options_.command_port); }

  void say(std::string trouble) {
    const std::lock_guard lock(mutex_);
    trouble_ = std::move(trouble);
  }

  void send(MessageId id, Bytes payload) {
    boost::system::error_code ignored;  // it is said again
    command_.socket.send_to(boost::asio::buffer(encode(Message{id, std::move(payload)})), server_, 0, ignored);
  }

  void receive(Port& port) {
    port.socket.async_receive_from(boost::asio::buffer(port.room), port.from,
                                   [this, &port](const boost::system::error_code& error, std::size_t size) {
                                     if (error == boost::asio::error::operation_aborted) return;
                                     // A refusal comes back as an error of the socket; the server may come yet.
                                     if (!error && port.from.address() == server_.address())
                                       take(std::span(port.room).first(size));
                                     receive(port);
                                   });
  }

  // --- what is to be said, and when ---------------------------------------------

  bool is_due(Clock::time_point& last, Clock::duration period, Clock::time_point now) {
    if (now - last < period) return false;
    last = now;
    return true;
  }

  void tick() {
    const auto now = Clock::now();
    if (info_ && now - heard_ > kGone) forget(fmt::format("{}: nothing heard for {} s", place(), kGone / 1s));
    if (!info_) {
      if (is_due(asked_, kAskAgain, now)) send(MessageId::kConnect, introduction());
    } else {
      if (is_due(kept_alive_, kKeepAlive, now)) send(MessageId::kKeepAlive, {});
      if (!models_known_ && is_due(asked_, kAskAgain, now)) send(MessageId::kModelRequest, {});
      if (is_due(echoed_, echoes_.size() < kEchoes ? Clock::duration(kTick) : Clock::duration(kKeepAlive), now))
        ask_echo(now);
      if (options_.version && !has_version_ && is_due(version_asked_, kAskAgain, now)) ask_version();
      if (now - framed_ > kNoFrames) {
        say(why_no_frames());
        // A server that started anew answers echoes, and knows nothing of us.
        if (is_due(introduced_, kNoFrames, now)) send(MessageId::kConnect, introduction());
      }
    }
    timer_.expires_after(kTick);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) tick();
    });
  }

  static Bytes introduction() {
    LittleEndianWriter out;
    std::string name = "jostle";
    name.resize(256, '\0');
    out.put(std::string_view(name)).put(std::array<std::uint8_t, 4>{}).put(std::array<std::uint8_t, 4>{4, 1, 0, 0});
    return out.take();
  }

  void ask_echo(Clock::time_point now) {
    LittleEndianWriter out;
    send(MessageId::kEcho, out.put(static_cast<std::uint64_t>(now.time_since_epoch().count())).take());
  }

  void ask_version() {
    const std::string words = fmt::format("Bitstream,{}.{}", options_.version->major, options_.version->minor);
    Bytes payload(words.begin(), words.end());
    payload.push_back(0);
    send(MessageId::kRequest, std::move(payload));
  }

  std::string why_no_frames() const {
    if (!info_->multicast) {
      return fmt::format("{}: connected, and no frames come: it may be paused, or a firewall lets no UDP in", place());
    }
    return fmt::format(
        "{}: connected, and no frames come: it sends multicast to {}.{}.{}.{}:{}; say --interface ADDRESS of the "
        "network "
        "it is in, let UDP port {} in, or have it send unicast",
        place(), info_->group[0], info_->group[1], info_->group[2], info_->group[3], info_->data_port,
        info_->data_port);
  }

  void forget(const std::string& why) {
    say(why);
    info_.reset();
    models_known_ = has_version_ = false;
    echoes_.clear();
    boost::system::error_code ignored;
    data_.socket.close(ignored);
  }

  // --- what is heard ------------------------------------------------------------

  void take(std::span<const std::uint8_t> datagram) {
    const auto message = decode(datagram);
    if (!message) return drop();
    heard_ = Clock::now();
    switch (message->id) {
      case MessageId::kServerInfo:
        return meet(message->payload);
      case MessageId::kModels:
        return learn(message->payload);
      case MessageId::kFrame:
        return look(message->payload);
      case MessageId::kEchoReply:
        return synchronise(message->payload);
      case MessageId::kResponse:
        if (!options_.version || has_version_) return;
        has_version_ = true;
        version_ = *options_.version;
        models_known_ = false;  // they look different now
        return;
      default:
        return;
    }
  }

  void drop() {
    const std::lock_guard lock(mutex_);
    ++counts_.malformed;
  }

  void meet(const Bytes& payload) {
    auto info_result = decode_server_info(payload);
    if (!info_result) return drop();
    if (!info_result->version().is_known()) {
      return say(fmt::format("{}: got NatNet {}.{}, wanted 3.0 to 4.1", place(), info_result->version().major,
                             info_result->version().minor));
    }
    if (info_ == *info_result) return;
    forget("");
    info_ = std::move(info_result).value();
    version_ = info_->version();
    framed_ = Clock::now();
    asked_ = kept_alive_ = echoed_ = version_asked_ = {};
    if (info_->multicast) join();
  }

  void join() {
    boost::system::error_code error;
    const boost::asio::ip::address_v4 group(info_->group);
    data_.socket.open(udp::v4(), error);
    if (!error) data_.socket.set_option(udp::socket::reuse_address(true), error);
    if (!error) data_.socket.bind({udp::v4(), info_->data_port}, error);
    const auto here = options_.interface.empty() ? boost::asio::ip::address_v4::any()
                                                 : boost::asio::ip::make_address_v4(options_.interface, error);
    if (!error) data_.socket.set_option(boost::asio::ip::multicast::join_group(group, here), error);
    if (error) return say(fmt::format("multicast {}:{}: {}", group.to_string(), info_->data_port, error.message()));
    receive(data_);
  }

  void learn(const Bytes& payload) {
    auto models_result = decode_models(payload, version_);
    if (!models_result) return drop();
    names_.clear();
    for (const Model& model : *models_result) names_[model.id] = model.name;
    models_known_ = true;
  }

  void synchronise(const Bytes& payload) {
    LittleEndianReader in(payload);
    const auto sent = Clock::time_point(Clock::duration(static_cast<Clock::rep>(in.get<std::uint64_t>())));
    const auto ticks = in.get<std::uint64_t>();
    const auto now = Clock::now();
    if (!in.done() || sent > now || sent < now - kGone) return drop();
    echoes_.push_back({.middle = sent + (now - sent) / 2, .ticks = ticks, .round_trip = now - sent});
    if (echoes_.size() > kEchoes) echoes_.pop_front();
    const std::lock_guard lock(mutex_);
    counts_.round_trip = std::chrono::duration<double>(best_echo()->round_trip).count();
  }

  std::deque<Echo>::const_iterator best_echo() const {
    return std::ranges::min_element(echoes_, {}, &Echo::round_trip);
  }

  // When it was exposed, by the clock of day.
  std::chrono::system_clock::time_point exposed(const Frame& frame) const {
    const auto now = Clock::now();
    const auto day = std::chrono::system_clock::now();
    if (echoes_.empty() || frame.mid_exposure == 0) return day;
    const Echo& echo = *best_echo();
    const double after = (static_cast<double>(frame.mid_exposure) - static_cast<double>(echo.ticks)) /
                         static_cast<double>(info_->clock_hz);
    const auto age = std::chrono::duration<double>(now - echo.middle).count() - after;
    // One that would be of the future, or older than a server is heard, says that clocks are not understood.
    if (age < 0.0 || age > std::chrono::duration<double>(kGone).count()) return day;
    return day - std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(age));
  }

  void look(const Bytes& payload) {
    if (!info_) return;
    auto frame_result = decode_frame(payload, version_);
    if (!frame_result) return drop();
    const Frame& frame = *frame_result;
    framed_ = heard_;
    if (frame.models_changed) models_known_ = false;
    Seen seen{.frame = frame.number, .exposed = exposed(frame), .timestamp = frame.timestamp, .bodies = {}};
    for (const Body& body : frame.bodies) {
      const auto name = names_.find(body.id);
      if (name != names_.end()) seen.bodies.push_back({name->second, body});
      models_known_ = models_known_ && name != names_.end();
    }
    {
      const std::lock_guard lock(mutex_);
      if (counts_.frames > 0 && frame.number > number_ + 1)
        counts_.lost += static_cast<std::uint64_t>(frame.number - number_ - 1);
      ++counts_.frames;
      trouble_.clear();
    }
    number_ = frame.number;
    if (!names_.empty()) on_seen_(seen);
  }

  const Options options_;
  const std::function<void(const Seen&)> on_seen_;

  boost::asio::io_context context_{1};
  boost::asio::steady_timer timer_{context_};
  Port command_{udp::socket(context_), {}, {}}, data_{udp::socket(context_), {}, {}};
  udp::endpoint server_;

  // Of its thread.
  std::optional<ServerInfo> info_;  // once it has answered
  Version version_;
  bool models_known_ = false, has_version_ = false;
  std::map<std::int32_t, std::string> names_;
  std::deque<Echo> echoes_;
  std::int64_t number_ = 0;  // of the newest frame
  Clock::time_point heard_{}, framed_{}, asked_{}, kept_alive_{}, echoed_{}, version_asked_{}, introduced_{};

  mutable std::mutex mutex_;  // guards trouble_ and counts_
  std::string trouble_;
  Counts counts_;
  std::jthread thread_;  // last: it uses all of the above
};

Result<std::unique_ptr<Client>> Client::start(Options options, std::function<void(const Seen&)> on_seen) {
  auto impl = std::make_unique<Impl>(std::move(options), std::move(on_seen));
  if (auto ok = impl->start(); !ok) return ok.error();
  return std::unique_ptr<Client>(new Client(std::move(impl)));
}

Client::Client(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Client::~Client() = default;
std::string Client::trouble() const { return impl_->trouble(); }
Client::Counts Client::counts() const { return impl_->counts(); }

}  // namespace jostle::perception::natnet
