#pragma once
/// \file
/// LiveSource: what is said in a domain, for viewers.

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "idl/types/result.hpp"
#include "services/bags/format/message_files.hpp"
#include "services/bags/selection.hpp"
#include "services/tools/view/view_server.hpp"

namespace jostle::tools {

/// Hands on every sample of every topic that `jostle record` would take, as it is on the wire; a topic becomes a
/// channel with its first sample. It only listens, unless viewers may control: then they have one parameter,
///
///   task.cancel   false; setting it to true cancels the goal that is at work
///
/// Threads  run() on one, set() from any; samples come on the middleware's.
class LiveSource {
 public:
  struct Options {
    std::optional<int> domain;
    bags::Selection selection;
    bags::MessageFiles messages{};                       ///< definitions beside the bag format's own
    bool control = false;                                ///< whether viewers may cancel; takes the role robot
    std::function<void(const std::string&)> on_warning;  ///< from any thread
  };

  explicit LiveSource(Options options);
  ~LiveSource();

  /// Shows what is said until a stop is requested; calls `on_ready` with the domain once it is subscribed. May be
  /// called once.
  /// Errors   those of bags::Subscriptions::open
  Result<void> run(ViewServer& server, std::stop_token stop, const std::function<void(int domain)>& on_ready);

  /// Does what a viewer asks for; returns all parameters.
  /// Errors   kInvalidArgument  another parameter or value, or none may be set
  ///          kUnavailable      no goal is at work
  Result<ViewParameters> set(const ViewParameters& wanted);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::tools
