#pragma once
/// \file
/// Publisher: where a playback's messages go.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "services/bags/play/topic_plan.hpp"
#include "services/bags/playback/lateness.hpp"
#include "services/bags/playback/playback.hpp"
#include "services/wire/dds/raw.hpp"

namespace jostle::bags {

/// Writes every message as it is in the bag, with what its first writer offered.
///
/// Moments   what writers keep for late readers is dropped, and the moment's messages are written
///           instead. So a late reader that asks for kept samples gets those of that moment, not
///           those of one that was played before.
/// Threads   one.
class Publisher final : public Playback::Sink {
 public:
  /// Throws SetupError.
  Publisher(const wire::Participant& participant, const std::vector<PlayedTopic>& topics);

  void on_message(const Message& message, TimePoint due) override;
  void on_moment(const std::vector<Message>& state) override;

  /// Sends the newest message of a state topic again if the topic has new readers. Called while playback stands:
  /// no next message comes then, and most readers of states ask for no kept samples.
  /// Latched topics need none of this.
  void tell_newcomers();

  /// Returns the topics that have fewer readers.
  std::vector<std::string> lacking(int readers) const;

  /// Whether all readers had everything by the deadline.
  bool wait_until_received(TimePoint deadline) const;

  std::uint64_t sent() const { return lateness_.count(); }  ///< moments not counted
  std::uint64_t refused() const { return refused_; }        ///< by the middleware
  std::map<std::string, std::uint64_t> messages() const;    ///< sent, by topic
  const Lateness& lateness() const { return lateness_; }

 private:
  struct Output {
    std::string name;
    wire::RawWriter writer;
    bool keeps = false;      // samples for late readers
    bool is_retold = false;  // see tell_newcomers()
    std::uint64_t sent = 0;
    std::vector<std::byte> newest;  // kept if the topic is retold
    int readers = 0;                // how many it had when last looked at
  };

  Output& output(int topic) { return outputs_[by_topic_.at(static_cast<std::size_t>(topic))]; }
  void write(Output& to, const Message& message);

  std::vector<Output> outputs_;
  std::vector<std::size_t> by_topic_;  // index into outputs_
  Lateness lateness_;
  std::uint64_t refused_ = 0;
  bool fresh_ = true;  // nothing was written since the last moment
};

}  // namespace jostle::bags
