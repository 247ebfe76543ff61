#pragma once
/// \file
/// What a topic promises, as one small value.

#include <array>
#include <string_view>

namespace jostle {

/// As the depth of a reader: every sample, one that waits for a lost predecessor to be sent
/// again included. For recorders.
inline constexpr int kKeepAll = 0;

/// A reader may not ask for more than the writer offers; both sides of a topic
/// take theirs from `topics.hpp`, so they agree. The file of profiles
/// (profiles.hpp) may say otherwise of a kind or a topic.
struct Qos {
  bool reliable = true;
  bool latched = false;  ///< transient-local: late readers get the last samples
  /// The writer keeps its last samples for late readers that ask, as recorders do; the
  /// system's own readers of the topic do not.
  bool retained = false;
  int depth = 10;         ///< samples kept per instance (keep-last)
  int instances = 1;      ///< most keys of a keyed type; the middleware's default is 10
  std::string_view kind;  ///< its profile's name in the file; empty: the file does not matter

  /// Whether the promises are equal, by whatever name.
  bool operator==(const Qos& other) const {
    return reliable == other.reliable && latched == other.latched && retained == other.retained &&
           depth == other.depth && instances == other.instances;
  }
};

/// Commands and requests, each of which matters. The depth holds a burst to one
/// peer, so that a slow peer is never the reason to block the writer.
inline constexpr Qos kTask{.depth = 512, .kind = "task"};
/// The same where a recorder that comes late wants the whole story.
inline constexpr Qos kCommand{.retained = true, .depth = 512, .kind = "command"};
/// Answers to requests: an asker whose reader the answerer has not found yet
/// gets them when it is found. Who asked sorts out what is its own.
inline constexpr Qos kAnswer{.latched = true, .depth = 16, .kind = "answer"};
/// The last word on something, for whoever comes later.
inline constexpr Qos kLatched{.latched = true, .depth = 1, .kind = "latched"};
/// Newest sample wins; a lost one is not worth repeating.
inline constexpr Qos kStream{.reliable = false, .depth = 1, .kind = "stream"};
/// States that people and recorders follow. What is kept covers a recorder's discovery.
inline constexpr Qos kState{.retained = true, .kind = "state"};
/// One latched sample per key.
inline constexpr Qos kCatalogue{.latched = true, .depth = 1, .instances = 4096, .kind = "catalogue"};

inline constexpr std::array kKinds{kTask, kCommand, kAnswer, kLatched, kStream, kState, kCatalogue};

}  // namespace jostle
