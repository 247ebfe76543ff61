#pragma once
/// \file
/// BagSource: a bag for viewers, with a clock that they set.

#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/message_files.hpp"
#include "services/bags/selection.hpp"
#include "services/tools/view/view_server.hpp"

namespace jostle::tools {

/// Plays a bag to all viewers of a server, on one clock. What they may say of it are parameters:
///
///   playback.time    s since the first message; setting it goes there, and shows the last message of every topic
///   playback.rate    s of the bag per second, bags::kSlowestRate to bags::kFastestRate
///   playback.paused  true or false; false at the end plays from the beginning
///   playback.loop    whether it begins again at the end
///   playback.length  s; cannot be set
///   playback.start   when the first message was recorded, s since 1970; cannot be set
///
/// Threads  run() on one, set() from any.
class BagSource {
 public:
  struct Options {
    std::filesystem::path bag;
    bags::Selection selection;
    bags::MessageFiles messages{};  ///< definitions of types that the bag brings none of
    bool paused = false;
    std::function<void(const std::string&)> on_warning;
  };

  /// Errors   those of BagReader::open and Playback::create
  ///          kInvalidArgument  no topic of it can be shown
  static Result<std::unique_ptr<BagSource>> open(Options options);
  ~BagSource();

  const bags::BagInfo& info() const;

  /// Sets what `wanted` names, all of it or nothing; returns all parameters.
  /// Error kInvalidArgument: no such parameter, or a value that it cannot have.
  Result<ViewParameters> set(const ViewParameters& wanted);

  /// Plays to `server` until a stop is requested. May be called once.
  void run(ViewServer& server, std::stop_token stop);

 private:
  struct Impl;
  explicit BagSource(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::tools
