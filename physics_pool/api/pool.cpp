#include "physics_pool/api/pool.hpp"

#include <fmt/format.h>

#include <condition_variable>
#include <mutex>
#include <optional>

namespace jostle::physics_pool {

Result<BatchReply> AsyncPool::run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop) {
  std::mutex mutex;  // guards reply
  std::condition_variable_any arrived;
  std::optional<Result<BatchReply>> reply;
  auto ticket_result = submit(batch, [&](Result<BatchReply> result) {
    const std::lock_guard lock(mutex);
    reply.emplace(std::move(result));
    arrived.notify_one();
  });
  if (!ticket_result) return ticket_result.error();
  std::unique_ptr<Ticket> ticket = std::move(ticket_result).value();

  std::unique_lock lock(mutex);
  if (!arrived.wait_until(lock, stop, deadline, [&] { return reply.has_value(); })) {
    lock.unlock();
    const std::uint32_t missing = ticket->missing();
    ticket.reset();  // nothing of this batch runs after the call
    if (stop.stop_requested()) return Error{Code::kCancelled, "batch: cancelled by its caller"};
    return Error{Code::kDeadline,
                 fmt::format("batch: {} of {} rollouts were unfinished at the deadline", missing, batch.samples)};
  }
  lock.unlock();
  ticket.reset();  // on_reply has left before its captures go
  return *std::move(reply);
}

}  // namespace jostle::physics_pool
