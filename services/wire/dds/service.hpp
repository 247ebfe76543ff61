#pragma once
/// \file
/// Service: answers requests as a ROS 2 service does.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "services/wire/dds/cdr.hpp"
#include "services/wire/dds/guid.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/types.hpp"

namespace jostle::wire {

/// Who asked, and which of its requests it was: what goes back with the answer, so that its asker knows it. ROS 2's
/// middlewares say it in two ways, and no service of one of them answers a client of the other:
///
///   rmw_fastrtps    beside the data, as related_sample_identity: the GUID of the client's reader of answers, and the
///                   number of the request among those of its writer
///   rmw_cyclonedds  in front of the data: eight bytes that name the client, and a number that it gave the request
///
/// Here the answer is made as the request was; the vendor in its writer's GUID (RTPS 2.2, 9.3.1.5) says which it is.
struct Asker {
  Guid reader{};                  ///< rmw_fastrtps
  std::uint64_t client = 0;       ///< rmw_cyclonedds
  std::int64_t number = 0;        ///< of the request
  bool is_in_data = false;        ///< whether it is rmw_cyclonedds
  std::uint64_t participant = 0;  ///< Participant::id() of who asked
};

/// Bytes of a request; what is larger is dropped.
inline constexpr std::size_t kMostRequest = std::size_t{4} << 20;
/// How long an answer waits until its asker's reader is found; the request may come sooner (rmw_fastrtps #392).
inline constexpr std::chrono::milliseconds kAskerPatience{500};

/// Data with what rmw_cyclonedds puts in front of it.
template <class T>
struct Enveloped {
  std::uint64_t client = 0;
  std::int64_t number = 0;
  T data;

  void deserialize(eprosima::fastcdr::Cdr& cdr) {
    cdr >> client >> number;
    data.deserialize(cdr);
  }
  void serialize(eprosima::fastcdr::Cdr& cdr) const {
    cdr << client << number;
    data.serialize(cdr);
  }
};

/// Everything about a service that does not depend on its types.
class ServiceBase {
 public:
  using OnRequest = std::function<void(std::span<const std::byte> request, const Asker& asker)>;

  /// `name`: ROS 2's, such as "/grasp/_action/send_goal", without a namespace; types as on the wire. What `on_request`
  /// throws is said, and the request is dropped. Throws SetupError.
  ServiceBase(const Participant& participant, const std::string& name, const std::string& request_type,
              const std::string& response_type, OnRequest on_request);
  /// Waits for a running callback; none runs afterwards.
  ~ServiceBase();
  ServiceBase(const ServiceBase&) = delete;
  ServiceBase& operator=(const ServiceBase&) = delete;

 protected:
  [[nodiscard]] bool send(const Asker& asker, std::span<const std::byte> response);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A Service calls back for every request, and sends an answer when it is told to.
///
/// Threads  the callback runs on the middleware's thread, one call at a time: quick, no entities made or destroyed;
///          answer() from any thread but that
template <class Request, class Response>
class Service : public ServiceBase {
 public:
  /// May move from the request.
  using OnRequest = std::function<void(Request&, const Asker&)>;

  Service(const Participant& participant, const std::string& name, OnRequest on_request)
      : ServiceBase(participant, name, Serializer<Request>().getName(), Serializer<Response>().getName(),
                    [on_request = std::move(on_request)](std::span<const std::byte> bytes, const Asker& asker) {
                      hand_on(bytes, asker, on_request);
                    }) {}

  /// Waits up to kAskerPatience until the asker can hear it. False: it cannot, or the middleware had no room.
  [[nodiscard]] bool answer(const Asker& asker, const Response& response) {
    return send(
        asker, asker.is_in_data ? to_cdr(Enveloped<Response>{asker.client, asker.number, response}) : to_cdr(response));
  }

 private:
  static void hand_on(std::span<const std::byte> bytes, Asker asker, const OnRequest& on_request) {
    if (!asker.is_in_data) return on_request(*sure(from_cdr<Request>(bytes)), asker);
    const auto request = sure(from_cdr<Enveloped<Request>>(bytes));
    asker.client = request->client;
    asker.number = request->number;
    on_request(request->data, asker);
  }

  template <class T>
  static std::unique_ptr<T> sure(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().message);
    return std::make_unique<T>(std::move(result).value());
  }
};

}  // namespace jostle::wire
