#pragma once
/// \file
/// What a topic promises, as one small value.

#include <array>
#include <string_view>

namespace jostle {

/// A reader of this depth keeps every sample, also one that waits until a lost predecessor is
/// sent again. For recorders.
inline constexpr int kKeepAll = 0;

/// What a writer offers, or a reader asks for. A reader may not ask for more than the writer offers; both sides of a
/// topic take their Qos from `topics.hpp`, so they agree. The file of profiles (profiles.hpp) may change it for a kind
/// of topic, or for one topic.
struct Qos {
  bool reliable = true;
  bool latched = false;  ///< transient-local: late readers get the last samples
  /// The writer keeps its last samples for late readers that ask, as recorders do; the
  /// system's own readers of the topic do not.
  bool retained = false;
  int depth = 10;           ///< samples kept per instance (keep-last)
  int instances = 1;        ///< most keys of a keyed type, of one writer; the middleware's default is 10
  int instances_heard = 1;  ///< of all writers that a reader hears, if more; some 200 bytes each
  std::string_view kind;    ///< its profile's name in the file; empty: the file does not matter

  /// Whether the promises are equal, by whatever name. What a reader has room for is none.
  bool operator==(const Qos& other) const {
    return reliable == other.reliable && latched == other.latched && retained == other.retained &&
           depth == other.depth && instances == other.instances;
  }
};

/// kTask is for commands and requests, none of which may be lost. The depth holds a burst to one
/// peer, so that a slow peer is never the reason to block the writer.
inline constexpr Qos kTask{.depth = 512, .kind = "task"};
/// kCommand is kTask with samples kept for a recorder that comes late and wants all of them.
inline constexpr Qos kCommand{.retained = true, .depth = 512, .kind = "command"};
/// kAnswer is for answers to requests. The writer keeps them, so an asker gets them even if its reader is discovered
/// only after they were sent. Every asker gets the answers to all requests, and picks out its own.
inline constexpr Qos kAnswer{.latched = true, .depth = 16, .kind = "answer"};
/// kLatched is for the last word on something; whoever comes later gets it, too.
inline constexpr Qos kLatched{.latched = true, .depth = 1, .kind = "latched"};
/// kStream is for topics of which only the newest sample counts; a lost one is not worth repeating.
inline constexpr Qos kStream{.reliable = false, .depth = 1, .kind = "stream"};
/// kState is for states that people and recorders follow. The samples kept cover the time that a recorder's discovery
/// takes.
inline constexpr Qos kState{.retained = true, .kind = "state"};
/// kCatalogue keeps one latched sample per key. Readers have room for many writers' keys: where there is none, the next
/// writer's would never arrive.
inline constexpr Qos kCatalogue{
    .latched = true, .depth = 1, .instances = 4096, .instances_heard = 1 << 20, .kind = "catalogue"};

inline constexpr std::array kKinds{kTask, kCommand, kAnswer, kLatched, kStream, kState, kCatalogue};

}  // namespace jostle
