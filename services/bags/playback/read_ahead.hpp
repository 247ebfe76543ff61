#pragma once
/// \file
/// ReadAhead: messages of a bag, fetched before they are due.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <vector>

#include "idl/types/result.hpp"
#include "services/bags/format/bag_reader.hpp"

namespace jostle::bags {

/// Reads and decompresses on a thread of its own, as far ahead as memory allows, so that
/// neither disk nor decompression delays a message.
///
/// Threads  one caller; on_news comes from the reading thread.
class ReadAhead {
 public:
  struct Options {
    std::vector<int> topics;          ///< indices of BagInfo::topics, at least one
    std::vector<int> state_topics;    ///< those among them whose last messages make a moment
    std::uint64_t memory = 64 << 20;  ///< bytes of messages to hold; one message more is held
    std::function<void()> on_news;    ///< called when something new can be taken; must be quick
  };

  ReadAhead(std::unique_ptr<BagReader> reader, Options options);
  ~ReadAhead();

  /// Starts over: messages from `from` to `until`, both included, and the moment before them.
  void seek(Time from, Time until);

  /// The last message before seek()'s `from` of every state topic that has one, in the order of
  /// their times. Nothing until it and what follows it have been read, and after it was taken.
  std::optional<std::vector<Message>> take_moment();

  /// The next message, or null while there is none. Valid until pop() or seek().
  const Message* peek();
  void pop();

  bool at_end();                   ///< no message will follow
  std::optional<Error> problem();  ///< why none will follow, if the bag is damaged there

  /// Whether take_moment(), peek(), at_end() or problem() has something to say by the deadline.
  bool wait(std::chrono::steady_clock::time_point deadline);

 private:
  bool has_news() const;
  void work(const std::stop_token& stop);
  // restart() reads what a seek asks for, fetch() one message more. Both are called with the lock and give it
  // up while they read; both return whether a caller that had nothing to take now has something.
  bool restart(std::unique_lock<std::mutex>& lock);
  bool fetch(std::unique_lock<std::mutex>& lock);

  const Options options_;
  std::unique_ptr<BagReader> reader_;  // used by the thread only

  std::mutex mutex_;  // guards all below
  std::condition_variable_any changed_;
  std::uint64_t asked_ = 0, answered_ = 0;  // seeks
  Time from_ = 0, until_ = 0;
  std::optional<std::vector<Message>> moment_;
  std::deque<Message> messages_;
  std::uint64_t held_ = 0;  // bytes of messages_
  bool done_ = false;
  std::optional<Error> problem_;

  std::jthread thread_;  // last: ends before what it uses
};

}  // namespace jostle::bags
