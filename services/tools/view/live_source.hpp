#pragma once
/// \file
/// LiveSource: what is said in a domain, for viewers.

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "idl/types/result.hpp"
#include "services/bags/format/message_files.hpp"
#include "services/bags/selection.hpp"
#include "services/tools/view/view_server.hpp"

namespace jostle::tools {

/// Hands on every sample of every topic that `jostle record` would take, as it is on the wire; a topic becomes a
/// channel with its first sample. It only listens.
///
/// Threads  the middleware's.
class LiveSource {
 public:
  struct Options {
    std::optional<int> domain;
    bags::Selection selection;
    bags::MessageFiles messages{};                       ///< definitions beside the bag format's own
    std::function<void(const std::string&)> on_warning;  ///< from any thread
  };

  /// Subscribed when this returns. `server` outlives it. Errors: those of bags::Subscriptions::open.
  static Result<std::unique_ptr<LiveSource>> open(Options options, ViewServer& server);
  ~LiveSource();

  int domain() const;
  int topics() const;  ///< subscribed so far

 private:
  struct Impl;
  explicit LiveSource(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::tools
