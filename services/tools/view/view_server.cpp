#include "services/tools/view/view_server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "services/common/process/files.hpp"
#include "services/common/process/random_id.hpp"
#include "services/tools/view/viewing.hpp"

namespace jostle::tools {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;
using Request = http::request<http::string_body>;

constexpr std::chrono::seconds kHandshake{10};  // to ask, and to be answered
constexpr std::chrono::seconds kIdle{30};       // a viewer that answers no ping is gone
constexpr std::uint32_t kMostHeader = 16 << 10;
constexpr std::uint64_t kMostBody = 1024;   // nobody sends any
constexpr std::size_t kMostUndecided = 64;  // connections that have not asked for anything yet

constexpr std::string_view kNoPage =
    "<!doctype html><title>Jostle</title><p>The page was not built: that takes Node.js, npm and, once, a registry. "
    "Foxglove connects to this address all the same.";

struct File {
  std::string type, content;
};

std::string media_type(const std::filesystem::path& file) {
  static const std::map<std::string, std::string> kTypes{{".html", "text/html; charset=utf-8"},
                                                         {".js", "text/javascript; charset=utf-8"},
                                                         {".css", "text/css; charset=utf-8"},
                                                         {".txt", "text/plain; charset=utf-8"},
                                                         {".svg", "image/svg+xml"}};
  const auto found = kTypes.find(file.extension());
  return found == kTypes.end() ? "application/octet-stream" : found->second;
}

// By the path that a browser asks for.
std::map<std::string, File, std::less<>> read_page(const std::filesystem::path& folder) {
  std::map<std::string, File, std::less<>> files;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    if (!entry.is_regular_file(ignored)) continue;
    auto text_result = common::read_text(entry.path());
    if (!text_result) continue;
    files["/" + entry.path().filename().string()] = {media_type(entry.path()), std::move(text_result).value()};
  }
  if (const auto index = files.find("/index.html"); index != files.end()) {
    files["/"] = index->second;
  } else {
    files["/"] = {"text/html; charset=utf-8", std::string(kNoPage)};
  }
  return files;
}

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

// A Host header without its port.
std::string_view host_name(std::string_view host) {
  const std::size_t bracket = host.rfind(']');
  const std::size_t colon = host.rfind(':');
  if (colon == std::string_view::npos || (bracket != std::string_view::npos && colon < bracket)) return host;
  return host.substr(0, colon);
}

bool is_loopback_name(std::string_view name) {
  if (name.starts_with('[') && name.ends_with(']')) name = name.substr(1, name.size() - 2);
  error_code error;
  const auto address = asio::ip::make_address(std::string(name), error);
  return error ? name == "localhost" : address.is_loopback();
}

// In a time that says nothing of where they differ.
bool equal(std::string_view got, std::string_view wanted) {
  unsigned difference = got.size() == wanted.size() ? 0u : 1u;
  for (std::size_t i = 0; i < got.size(); ++i) {
    difference |= static_cast<unsigned char>(got[i]) ^ static_cast<unsigned char>(wanted[i % wanted.size()]);
  }
  return difference == 0;
}

std::string_view path_of(std::string_view target) { return target.substr(0, target.find('?')); }

// Tokens are hexadecimal or a user's own without escapes.
std::string_view token_in(const Request& request) {
  const std::string_view given = view(request[http::field::authorization]);
  constexpr std::string_view kBearer = "Bearer ";
  if (given.starts_with(kBearer)) return given.substr(kBearer.size());
  const std::string_view target = view(request.target());
  std::string_view query = target.substr(std::min(target.size(), path_of(target).size() + 1));
  while (!query.empty()) {
    const std::string_view pair = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(query.size(), pair.size() + 1));
    constexpr std::string_view kName = "token=";
    if (pair.starts_with(kName)) return pair.substr(kName.size());
  }
  return {};
}

}  // namespace

struct ViewServer::Impl {
  class Connection;
  class Viewer;

  Impl(ViewServerOptions given, Watcher watcher_given)
      : options(std::move(given)), watcher(std::move(watcher_given)), files(read_page(options.page)) {}

  ~Impl() {
    context.stop();
    if (thread.joinable()) thread.join();
  }

  Result<void> listen();
  void accept();
  http::response<http::string_body> answer(const Request& request);
  // Why this request is refused; nothing if it is not.
  std::optional<std::pair<http::status, std::string>> objection(const Request& request, bool wants_socket);
  std::string metrics() const;
  ViewServerCounts counts() const;

  const ViewServerOptions options;
  const Watcher watcher;
  const std::map<std::string, File, std::less<>> files;
  const std::string session = fmt::format("{:016x}", common::random_id());

  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  bool at_loopback = true;
  std::uint16_t port = 0;
  std::size_t undecided = 0;  // the server's thread only

  mutable std::mutex mutex;  // guards all below, and what viewers have of it
  Exhibition shared;
  std::vector<std::shared_ptr<Viewer>> viewers;

  std::jthread thread;  // last: ends before what it uses
};

// One WebSocket. Functions with `locked` in their names are called with Impl::mutex held, from any thread; the others
// run on the server's.
class ViewServer::Impl::Viewer : public std::enable_shared_from_this<Viewer> {
 public:
  Viewer(Impl& server, beast::tcp_stream stream)
      : server_(server), socket_(std::move(stream)), viewing_(server.shared, server.options.most_waiting) {}

  void start(const Request& request) {
    socket_.set_option(websocket::stream_base::timeout{kHandshake, kIdle, true});
    socket_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set(http::field::sec_websocket_protocol, std::string(kViewProtocol));
    }));
    socket_.read_message_max(server_.options.most_request);
    socket_.async_accept(request, [self = shared_from_this()](error_code error) { self->accepted(error); });
  }

  void say_locked(const SharedText& text) {
    viewing_.say(text);
    wake_locked();
  }

  void send_locked(std::size_t channel, const SharedSample& sample) {
    if (viewing_.send(channel, sample)) wake_locked();
  }

  void set_time_locked(bags::Time time) {
    viewing_.set_time(time);
    wake_locked();
  }

  void forget_locked() { viewing_.forget(); }

  // Of values that have changed.
  void tell_locked(const ViewParameters& changed) {
    viewing_.tell(changed);
    wake_locked();
  }

 private:
  void accepted(error_code error) {
    if (error) return;
    {
      const std::lock_guard lock(server_.mutex);
      if (server_.viewers.size() >= server_.options.most_viewers) {
        ++server_.shared.count.refused;
        closing_ = true;
      }
      server_.viewers.push_back(shared_from_this());
      const ViewServerOptions& options = server_.options;
      viewing_.begin(server_info_text(options.name, options.has_playback, options.has_playback || options.has_control,
                                      server_.session));
    }
    read();
    write();
  }

  void wake_locked() {
    if (closing_) return;
    if (viewing_.is_overfull()) {  // who neither reads nor stops asking
      closing_ = true;
      awake_ = false;
    }
    if (std::exchange(awake_, true)) return;
    asio::post(server_.context, [self = shared_from_this()] { self->write(); });
  }

  void read() {
    socket_.async_read(request_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) return self->leave();
      self->take_request();
      self->read();
    });
  }

  void take_request() {
    auto request_result = socket_.got_text() ? parse_view_request(beast::buffers_to_string(request_.cdata()))
                                             : invalid("frame", "a binary one", "text: this server takes no messages");
    request_.consume(request_.size());
    auto done = request_result ? perform(*request_result) : Result<void>(request_result.error());
    if (done) return;
    const std::lock_guard lock(server_.mutex);
    ++server_.shared.count.invalid_requests;
    say_locked(std::make_shared<const std::string>(status_text(ViewStatus::kError, done.error().message)));
  }

  Result<void> perform(const ViewRequest& request) {
    if (const auto* set = std::get_if<SetParameters>(&request); set && server_.watcher.on_set) return set_all(*set);
    const std::lock_guard lock(server_.mutex);
    auto done = viewing_.perform(request);
    wake_locked();
    return done;
  }

  Result<void> set_all(const SetParameters& request) {
    auto set_result = server_.watcher.on_set(request.values);  // takes the lock to tell others
    if (!set_result) return set_result.error();
    if (!request.id) return {};
    const std::lock_guard lock(server_.mutex);
    say_locked(std::make_shared<const std::string>(parameters_text(*set_result, request.id)));
    return {};
  }

  void write() {
    {
      const std::lock_guard lock(server_.mutex);
      if (closing_) return close();
      if (writing_) return;
      auto frame = viewing_.next();
      awake_ = frame.has_value();
      if (!frame) return;
      frame_ = *std::move(frame);
    }
    writing_ = true;
    std::vector<asio::const_buffer> buffers;
    if (frame_.text) {
      buffers = {asio::buffer(*frame_.text)};
    } else {
      buffers = {asio::buffer(frame_.head.data(), frame_.head_size)};
      if (frame_.sample) buffers.emplace_back(frame_.sample->data.data(), frame_.sample->data.size());
    }
    socket_.text(frame_.text != nullptr);
    socket_.async_write(buffers, [self = shared_from_this()](error_code error, std::size_t) {
      self->writing_ = false;
      if (error) return self->leave();
      self->write();
    });
  }

  // With the lock held; leave() follows when the read ends.
  void close() {
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

  void leave() {
    const std::lock_guard lock(server_.mutex);
    closing_ = true;
    std::erase(server_.viewers, shared_from_this());
    close();
  }

  Impl& server_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer request_;

  bool writing_ = false;
  ViewFrame frame_;  // that is being written

  // Guarded by Impl::mutex.
  bool awake_ = true;  // write() runs, or will
  bool closing_ = false;
  Viewing viewing_;
};

// One that has just come, until it is known what it wants.
class ViewServer::Impl::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Impl& server, tcp::socket socket) : server_(server), stream_(std::move(socket)) { ++server_.undecided; }
  ~Connection() { --server_.undecided; }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void start() {
    parser_.header_limit(kMostHeader);
    parser_.body_limit(kMostBody);
    stream_.expires_after(kHandshake);
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](error_code error, std::size_t) {
      if (!error) self->decide();
    });
  }

 private:
  void decide() {
    const Request& request = parser_.get();
    const bool wants_socket = websocket::is_upgrade(request);
    if (wants_socket && !server_.objection(request, true)) {
      stream_.expires_never();  // a WebSocket has timeouts of its own
      std::make_shared<Viewer>(server_, std::move(stream_))->start(request);
      return;
    }
    response_ = server_.answer(request);
    stream_.expires_after(kHandshake);
    http::async_write(stream_, response_, [self = shared_from_this()](error_code, std::size_t) {
      error_code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  http::response<http::string_body> response_;
};

Result<void> ViewServer::Impl::listen() {
  error_code error;
  const auto address = asio::ip::make_address(options.address, error);
  if (error) return invalid("address", options.address, "an IPv4 or IPv6 address");
  at_loopback = address.is_loopback();
  if (!at_loopback && options.token.empty()) {
    return invalid("address", options.address + " without a token", "loopback, or a token that viewers must give");
  }
  const tcp::endpoint place(address, options.port);
  acceptor.open(place.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(place, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) {
    return Error{Code::kUnavailable, fmt::format("{} port {}: cannot be listened at: {}; --port 0 takes a free one",
                                                 options.address, options.port, error.message())};
  }
  port = acceptor.local_endpoint(error).port();
  accept();
  thread = std::jthread([this] { context.run(); });
  return {};
}

void ViewServer::Impl::accept() {
  acceptor.async_accept([this](error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    error_code ignored;
    if (!error) socket.set_option(tcp::no_delay(true), ignored);  // a sample does not wait for the one before
    if (!error && undecided < kMostUndecided) std::make_shared<Connection>(*this, std::move(socket))->start();
    accept();
  });
}

std::optional<std::pair<http::status, std::string>> ViewServer::Impl::objection(const Request& request,
                                                                                bool wants_socket) {
  const std::string_view host = view(request[http::field::host]);
  if (at_loopback && !is_loopback_name(host_name(host))) {
    return {{http::status::misdirected_request, fmt::format("Host: got {}, wanted localhost", host)}};
  }
  const std::string_view path = path_of(view(request.target()));
  if (!options.token.empty() && (wants_socket || path == "/metrics") && !equal(token_in(request), options.token)) {
    return {{http::status::unauthorized, "token: got none or another one, wanted the one that jostle view has shown"}};
  }
  if (!wants_socket) return {};
  const std::string_view origin = view(request[http::field::origin]);
  const bool is_ours = origin.empty() || origin == fmt::format("http://{}", host);
  if (!is_ours && std::ranges::count(options.origins, origin) == 0) {
    return {{http::status::forbidden,
             fmt::format("Origin: got {}, wanted this server's own page, or one named by --allow-origin", origin)}};
  }
  bool speaks = false;
  for (const auto& name : http::token_list(request[http::field::sec_websocket_protocol])) {
    speaks |= view(name) == kViewProtocol;
  }
  if (!speaks) {
    return {
        {http::status::bad_request, fmt::format("Sec-WebSocket-Protocol: got {}, wanted {}",
                                                view(request[http::field::sec_websocket_protocol]), kViewProtocol)}};
  }
  const std::lock_guard lock(mutex);
  if (viewers.size() < options.most_viewers) return {};
  return {{http::status::service_unavailable, fmt::format("got {} viewers already, wanted fewer", viewers.size())}};
}

http::response<http::string_body> ViewServer::Impl::answer(const Request& request) {
  http::response<http::string_body> response(http::status::ok, 11);
  response.keep_alive(false);
  response.set("Content-Security-Policy",
               "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set(http::field::cache_control, "no-cache");
  response.set(http::field::content_type, "text/plain; charset=utf-8");
  const std::string_view path = path_of(view(request.target()));
  const auto file = files.find(path);
  if (auto refused = objection(request, websocket::is_upgrade(request))) {
    response.result(refused->first);
    response.body() = std::move(refused->second) + "\n";
    const std::lock_guard lock(mutex);
    ++shared.count.refused;
  } else if (request.method() != http::verb::get && request.method() != http::verb::head) {
    response.result(http::status::method_not_allowed);
    response.set(http::field::allow, "GET, HEAD");
  } else if (path == "/metrics") {
    response.body() = metrics();
  } else if (file != files.end()) {
    response.set(http::field::content_type, file->second.type);
    response.body() = file->second.content;
  } else {
    response.result(http::status::not_found);
    response.body() = "no such page\n";
  }
  response.prepare_payload();
  if (request.method() == http::verb::head) response.body().clear();
  return response;
}

ViewServerCounts ViewServer::Impl::counts() const {
  const std::lock_guard lock(mutex);
  ViewServerCounts counts = shared.count;
  counts.viewers = viewers.size();
  counts.channels = shared.channels.size();
  return counts;
}

// The text format of Prometheus, version 0.0.4.
std::string ViewServer::Impl::metrics() const {
  const ViewServerCounts now = counts();
  std::string text;
  const auto add = [&](std::string_view name, std::string_view type, std::string_view help, std::uint64_t value) {
    text += fmt::format("# HELP jostle_view_{0} {1}\n# TYPE jostle_view_{0} {2}\njostle_view_{0} {3}\n", name, help,
                        type, value);
  };
  add("viewers", "gauge", "Viewers that are connected.", now.viewers);
  add("channels", "gauge", "Topics that are served.", now.channels);
  add("samples_in_total", "counter", "Samples that came from the domain or the bag.", now.samples_in);
  add("samples_out_total", "counter", "Samples that were handed to viewers.", now.samples_out);
  add("sent_bytes_total", "counter", "Bytes that were handed to viewers.", now.bytes_out);
  add("dropped_samples_total", "counter", "Samples that a viewer was too slow for.", now.dropped);
  add("refused_connections_total", "counter", "Connections that had no right, or were too many.", now.refused);
  add("invalid_requests_total", "counter", "Requests that were answered with an error.", now.invalid_requests);
  return text;
}

Result<std::unique_ptr<ViewServer>> ViewServer::start(ViewServerOptions options, Watcher watcher) {
  auto impl = std::make_unique<Impl>(std::move(options), std::move(watcher));
  if (auto ok = impl->listen(); !ok) return ok.error();
  return std::unique_ptr<ViewServer>(new ViewServer(std::move(impl)));
}

ViewServer::ViewServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ViewServer::~ViewServer() = default;

std::uint16_t ViewServer::port() const { return impl_->port; }

std::string ViewServer::url() const {
  const ViewServerOptions& own = impl_->options;
  const bool is_v6 = own.address.find(':') != std::string::npos;
  return fmt::format("http://{}:{}/{}{}", is_v6 ? "[" + own.address + "]" : own.address, impl_->port,
                     own.token.empty() ? "" : "?token=", own.token);
}

int ViewServer::add_channel(const bags::Topic& topic, bool keeps) {
  const std::lock_guard lock(impl_->mutex);
  const auto number = static_cast<std::uint32_t>(impl_->shared.channels.size());
  impl_->shared.channels.push_back({topic, keeps, nullptr});
  const auto text = std::make_shared<const std::string>(advertise_text(number, {topic}));
  for (const auto& viewer : impl_->viewers) viewer->say_locked(text);
  return static_cast<int>(number);
}

void ViewServer::send(int channel, bags::Time time, std::span<const std::byte> data) {
  const auto sample = std::make_shared<const ShownSample>(ShownSample{time, {data.begin(), data.end()}});
  const auto place = static_cast<std::size_t>(channel);
  const std::lock_guard lock(impl_->mutex);
  ++impl_->shared.count.samples_in;
  if (impl_->shared.channels[place].keeps) impl_->shared.channels[place].last = sample;
  for (const auto& viewer : impl_->viewers) viewer->send_locked(place, sample);
}

void ViewServer::set_time(bags::Time time) {
  const std::lock_guard lock(impl_->mutex);
  impl_->shared.time = time;
  for (const auto& viewer : impl_->viewers) viewer->set_time_locked(time);
}

void ViewServer::start_over() {
  const std::lock_guard lock(impl_->mutex);
  for (Exhibition::Channel& channel : impl_->shared.channels) channel.last.reset();
  for (const auto& viewer : impl_->viewers) viewer->forget_locked();
}

void ViewServer::set_parameters(const ViewParameters& values) {
  const std::lock_guard lock(impl_->mutex);
  ViewParameters changed;
  for (const auto& [name, value] : values) {
    const auto known = impl_->shared.parameters.find(name);
    if (known == impl_->shared.parameters.end() || known->second != value) changed[name] = value;
  }
  impl_->shared.parameters = values;
  if (changed.empty()) return;
  for (const auto& viewer : impl_->viewers) viewer->tell_locked(changed);
}

void ViewServer::tell(ViewStatus level, const std::string& message) {
  const std::lock_guard lock(impl_->mutex);
  const auto text = std::make_shared<const std::string>(status_text(level, message));
  for (const auto& viewer : impl_->viewers) viewer->say_locked(text);
}

ViewServerCounts ViewServer::counts() const { return impl_->counts(); }

}  // namespace jostle::tools
