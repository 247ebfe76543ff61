#pragma once
/// \file
/// ViewServer: samples, and a page that draws them, for viewers.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/message.hpp"
#include "services/tools/view/protocol.hpp"

namespace jostle::tools {

struct ViewServerOptions {
  std::string name = "jostle";          ///< as viewers show it
  std::string address = "127.0.0.1";    ///< IPv4 or IPv6 to listen at; other than loopback wants a token
  std::uint16_t port = 8765;            ///< 0: any
  std::string token;                    ///< that viewers must give; "": none
  std::vector<std::string> origins;     ///< of pages elsewhere that may connect, "https://app.foxglove.dev"
  std::filesystem::path page;           ///< folder of the page's files; they are read when the server starts
  bool has_playback = false;            ///< there is a clock that viewers may set, by parameters
  bool has_control = false;             ///< there is something else that they may set
  std::size_t most_viewers = 256;       ///< more are refused
  std::size_t most_waiting = 4 << 20;   ///< bytes of samples that wait for one viewer; the oldest are dropped
  std::size_t most_request = 64 << 10;  ///< bytes of a request; a longer one ends its connection
};

/// What a server has done so far, and who is there.
struct ViewServerCounts {
  std::size_t viewers = 0, channels = 0;
  std::uint64_t samples_in = 0;  ///< given to send()
  std::uint64_t samples_out = 0, bytes_out = 0;
  std::uint64_t dropped = 0;           ///< samples that a viewer was too slow for
  std::uint64_t refused = 0;           ///< connections without the right, or too many of them
  std::uint64_t invalid_requests = 0;  ///< that were answered with an error
};

/// Serves, at one port,
///
///   a WebSocket   kViewProtocol: channels, samples, time, parameters
///   GET /         the page, and its files
///   GET /metrics  ViewServerCounts for Prometheus
///
/// A viewer that reads slower than samples come loses the oldest of those that wait for it, and nobody else notices.
/// One that stops reading, or answers no ping, is disconnected after half a minute.
///
/// Who may connect: pages of this server, pages of `origins`, and programs, which have no origin. At loopback the name
/// that was asked for must be one of loopback too, so that no foreign name that leads there (DNS rebinding) is of use.
/// Where there is a token, WebSocket and /metrics want it, as ?token= or as `Authorization: Bearer`.
///
/// Threads  one of its own; all functions are safe from any.
class ViewServer {
 public:
  struct Watcher {
    /// Sets what a viewer asks for, and returns all that holds then. On the server's thread; may be empty.
    std::function<Result<ViewParameters>(const ViewParameters&)> on_set;
  };

  /// Listens when this returns.
  /// Errors   kInvalidArgument  an address that is none, or not loopback without a token
  ///          kUnavailable      the port is taken
  static Result<std::unique_ptr<ViewServer>> start(ViewServerOptions options, Watcher watcher);
  ~ViewServer();

  std::uint16_t port() const;
  /// Returns where a browser finds the page, its token included.
  std::string url() const;

  /// Adds a channel and returns its number, which counts from 0. `keeps`: its last sample is sent to whoever
  /// subscribes later.
  int add_channel(const bags::Topic& topic, bool keeps);

  void send(int channel, bags::Time time, std::span<const std::byte> data);

  /// Says what time it is on the playback's clock.
  void set_time(bags::Time time);
  /// Forgets samples that wait and those that channels keep: time goes on from somewhere else.
  void start_over();

  /// Sets all parameters, and tells who follows them of those that are new or have changed.
  void set_parameters(const ViewParameters& values);

  /// Tells all viewers something.
  void tell(ViewStatus level, const std::string& message);

  ViewServerCounts counts() const;

 private:
  struct Impl;
  explicit ViewServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::tools
