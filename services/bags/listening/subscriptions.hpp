#pragma once
/// \file
/// Subscriptions: readers of whatever is selected, before and after its writers appear.

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/message.hpp"
#include "services/bags/selection.hpp"
#include "services/wire/dds/reader.hpp"

namespace jostle::bags {

/// Subscribes
///
///   to the system's own topics at once, asking for what their writers keep;
///   to every other topic as soon as a writer or a reader of it is found, asking for what
///   the writer offers: a writer that keeps its last samples is asked for them.
///
/// A writer that offers less than the readers so far ask for gets a reader of its own. A sample
/// that comes to two readers counts once. Says why a topic is left out: a type whose definition
/// is unknown, a key that cannot be found, two types on one topic. Topics and types that are not
/// ROS 2's are passed over, and its hidden topics (/grasp/_action/status) unless globs select topics.
class Subscriptions {
 public:
  struct Options {
    std::string name = "jostle_record";  ///< of the participant, as tools list it
    std::optional<int> domain;
    wire::Role role = wire::Role::kObserver;  ///< that an identity must have
    Selection selection;
    /// Returns the text of a type such as "jostle_msgs/msg/Goal". An error says why there is none.
    std::function<Result<std::string>(const std::string& type)> definition;
    /// Called on the middleware's threads, maybe on several at once. `topic` is an index for topic().
    std::function<void(int topic, std::span<const std::byte>, const wire::Origin&)> on_sample;
    /// Called on a thread of this class.
    std::function<void(const std::string&)> on_warning;
  };

  /// Every reader of the system's own topics is there when this returns.
  /// Errors   those of Participant::open, kUnavailable
  static Result<std::unique_ptr<Subscriptions>> open(Options options);
  ~Subscriptions();

  const wire::Participant& participant() const;

  int topics() const;
  /// Returns a topic's name, type, definition, and what its first writer offered.
  Topic topic(int index) const;

  /// Counts the samples that did not come, between the first and the last one of each writer.
  std::uint64_t missing(int topic) const;

  /// Returns the topics that are written and subscribed to, yet none of whose writers matches a reader here, because
  /// they offer what no reader asks for: exclusive ownership, say. With the number of
  /// refusals that the middleware tells of. No topic is subscribed to after this.
  std::vector<std::pair<std::string, std::uint64_t>> unmatched();

  /// Returns topics of ROS 2 that were found and are not selected, the first of them.
  std::vector<std::string> passed_over() const;

  /// Ends all callbacks: no on_sample follows.
  void close();

 private:
  struct Impl;
  explicit Subscriptions(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::bags
