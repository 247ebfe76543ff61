#include "physics_pool/api/pool.hpp"

#include <fmt/format.h>

#include <condition_variable>
#include <mutex>
#include <optional>

namespace jostle::physics_pool {

Result<std::vector<BatchReply>> Pool::run_all(std::span<const RolloutBatch> batches, TimePoint deadline,
                                              std::stop_token stop) {
  std::vector<BatchReply> replies;
  for (const RolloutBatch& batch : batches) {
    auto reply_result = run(batch, deadline, stop);
    if (!reply_result) return reply_result.error();
    replies.push_back(std::move(reply_result).value());
  }
  return replies;
}

Result<BatchReply> AsyncPool::run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop) {
  auto replies_result = run_all({&batch, 1}, deadline, std::move(stop));
  if (!replies_result) return replies_result.error();
  return std::move(replies_result->front());
}

Result<std::vector<BatchReply>> AsyncPool::run_all(std::span<const RolloutBatch> batches, TimePoint deadline,
                                                   std::stop_token stop) {
  const Error cancelled{Code::kCancelled, "batch: cancelled by its caller"};
  if (stop.stop_requested()) return cancelled;  // however short the batch is
  std::mutex mutex;                             // guards missing, failure and replies
  std::condition_variable_any arrived;
  std::size_t missing = batches.size();
  std::optional<Error> failure;
  std::vector<BatchReply> replies(batches.size());
  std::vector<std::unique_ptr<Ticket>> tickets;  // go first: on_reply has left before its captures do
  for (std::size_t i = 0; i < batches.size(); ++i) {
    auto ticket_result = submit(batches[i], [&, i](Result<BatchReply> result) {
      const std::lock_guard lock(mutex);
      --missing;
      if (result) {
        replies[i] = std::move(result).value();
      } else if (!failure) {
        failure = result.error();
      }
      arrived.notify_one();
    });
    if (!ticket_result) return ticket_result.error();
    tickets.push_back(std::move(ticket_result).value());
  }

  std::unique_lock lock(mutex);
  const bool over = arrived.wait_until(lock, stop, deadline, [&] { return missing == 0 || failure; });
  lock.unlock();
  std::uint64_t unfinished = 0, samples = 0;
  for (std::size_t i = 0; !over && i < tickets.size(); ++i) {
    unfinished += tickets[i]->missing();
    samples += batches[i].samples;
  }
  tickets.clear();  // nothing of these batches runs after the call
  if (failure) return *failure;
  if (over) return replies;
  if (stop.stop_requested()) return cancelled;
  return Error{Code::kDeadline,
               fmt::format("batch: {} of {} rollouts were unfinished at the deadline", unfinished, samples)};
}

}  // namespace jostle::physics_pool
