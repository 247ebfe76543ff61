#pragma once
/// \file
/// What there is to see, and what each viewer sees of it. No socket in it: who has one asks what is to go out next.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "services/tools/view/protocol.hpp"
#include "services/tools/view/view_server.hpp"

namespace jostle::tools {

/// A sample as all viewers share it.
struct ShownSample {
  bags::Time time = 0;
  std::vector<std::byte> data;

  /// Returns the bytes that it takes while it waits; one without data takes some all the same.
  std::size_t memory() const { return 64 + data.size(); }
};
using SharedSample = std::shared_ptr<const ShownSample>;
using SharedText = std::shared_ptr<const std::string>;

/// What all viewers have in common.
///
/// Threads  none of its own: one lock of its owner's guards it and every Viewing of it.
struct Exhibition {
  struct Channel {
    bags::Topic topic;
    bool keeps = false;  ///< its last sample is for whoever subscribes later
    SharedSample last;
  };

  std::deque<Channel> channels;  ///< by number
  ViewParameters parameters;
  std::optional<bags::Time> time;  ///< of the playback's clock
  ViewServerCounts count;
};

/// What goes out as one frame: a text, or bytes.
struct ViewFrame {
  SharedText text;
  std::array<std::uint8_t, 13> head{};  ///< else these come first,
  std::size_t head_size = 0;
  SharedSample sample;  ///< and its data behind them; may be null

  std::size_t size() const { return text ? text->size() : head_size + (sample ? sample->data.size() : 0); }
};

/// One viewer: what it subscribes to and follows, and what waits for it.
class Viewing {
 public:
  /// `most_waiting`: bytes of samples; then the oldest are dropped.
  Viewing(Exhibition& shared, std::size_t most_waiting) : shared_(shared), most_waiting_(most_waiting) {}

  /// Says what every viewer hears first: about the server, its channels, its time.
  void begin(std::string server_info);

  /// Does what it asks for, all but SetParameters, which is not for one viewer to do.
  /// Error kInvalidArgument: there is no such thing, or it asks for too much.
  Result<void> perform(const ViewRequest& request);

  void say(SharedText text);
  void say(std::string text) { say(std::make_shared<const std::string>(std::move(text))); }
  /// Puts in a sample for each of its subscriptions to the channel; returns whether there is one.
  bool send(std::size_t channel, const SharedSample& sample);
  void set_time(bags::Time time) { time_ = time; }
  /// Drops the samples that wait.
  void forget();
  /// Says those of the values that have changed which it follows.
  void tell(const ViewParameters& changed);

  /// Whether more words wait for it than for anybody who reads them.
  bool is_overfull() const;

  /// Takes what is to go out next: words before times before samples; nothing if nothing waits.
  std::optional<ViewFrame> next();

 private:
  struct Parcel {
    std::uint32_t subscription = 0;
    SharedSample sample;
  };

  Result<void> perform(const Subscribe& request);
  Result<void> perform(const Unsubscribe& request);
  Result<void> perform(const GetParameters& request);
  Result<void> perform(const SetParameters& request);
  Result<void> perform(const FollowParameters& request);
  void put(Parcel parcel);

  Exhibition& shared_;
  const std::size_t most_waiting_;
  std::map<std::uint32_t, std::size_t> subscriptions_;             // channels, by the viewer's number
  std::map<std::size_t, std::vector<std::uint32_t>> subscribers_;  // the reverse
  std::set<std::string> followed_;
  bool follows_all_ = false;
  std::deque<SharedText> words_;
  std::deque<Parcel> parcels_;
  std::size_t words_bytes_ = 0, parcels_bytes_ = 0;
  std::optional<bags::Time> time_;
};

}  // namespace jostle::tools
