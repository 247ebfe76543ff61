#pragma once
/// \file
/// EndpointWatch: which writers and readers there are in a domain.

#include <functional>
#include <memory>
#include <string>

#include "services/wire/dds/guid.hpp"

namespace eprosima::fastdds::dds {
class DomainParticipantListener;
}

namespace jostle::wire {

/// A writer or reader of another participant, as it announces itself.
struct Endpoint {
  enum class Kind { kWriter, kReader };

  Kind kind = Kind::kWriter;
  Guid guid{};
  std::string topic, type;  ///< as on the wire; names.hpp turns them into those of ROS 2
  bool keyed = false;
  bool reliable = false;  ///< offered by a writer, asked for by a reader
  bool latched = false;   ///< transient-local or more, likewise
};

/// An EndpointWatch hears of every endpoint of the domain as it comes and goes. Give it to
/// ParticipantOptions::watch, of one participant.
///
/// Threads  the callbacks run on the middleware's threads, before a sample of that writer
///          can arrive. They must be quick, must not throw, and must not make or destroy
///          writers or readers.
class EndpointWatch {
 public:
  using OnEndpoint = std::function<void(const Endpoint&)>;

  explicit EndpointWatch(OnEndpoint on_found, OnEndpoint on_gone = {});
  ~EndpointWatch();
  EndpointWatch(const EndpointWatch&) = delete;
  EndpointWatch& operator=(const EndpointWatch&) = delete;

  eprosima::fastdds::dds::DomainParticipantListener& listener();

  /// From now on keeps what it hears to itself. For join().
  void hold();
  /// Tells what it heard since hold(), or forgets it, and holds back nothing more.
  void let_go(bool tell);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::wire
