#include "services/tools/view/live_source.hpp"

#include <chrono>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "services/bags/listening/record_clock.hpp"
#include "services/bags/listening/subscriptions.hpp"
#include "services/common/process/program.hpp"
#include "services/wire/dds/cdr.hpp"
#include "services/wire/dds/raw.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::tools {
namespace {

constexpr const char* kCancel = "task.cancel";

template <class T>
wire::RawTopic raw(const wire::Participant& participant, const wire::Topic<T>& topic) {
  return {participant.wire_name(topic.name, topic.scope), wire::Serializer<T>().getName(), topic.qos};
}

// Knows which goal is at work, and cancels it.
class Commander {
 public:
  explicit Commander(const wire::Participant& participant)
      : cancels_(participant, raw(participant, wire::topics::kTaskCancel)),
        feedback_(participant, raw(participant, wire::topics::kTaskFeedback),
                  [this](std::span<const std::byte> data, const wire::Origin&) {
                    auto feedback_result = wire::from_cdr<jostle_msgs::msg::Feedback>(data);
                    if (!feedback_result) return;
                    const std::lock_guard lock(mutex_);
                    goal_id_ = feedback_result->goal_id();
                  }) {}

  Result<void> cancel() {
    jostle_msgs::msg::Cancel cancel;
    {
      const std::lock_guard lock(mutex_);
      cancel.goal_id(goal_id_);
    }
    if (cancel.goal_id().empty())
      return Error{Code::kUnavailable, std::string(kCancel) + ": got true, wanted a goal that is at work"};
    if (!cancels_.write(wire::to_cdr(cancel)))
      return Error{Code::kUnavailable, std::string(kCancel) + ": the middleware did not take it; set it again"};
    return {};
  }

 private:
  std::mutex mutex_;     // guards goal_id_
  std::string goal_id_;  // of the newest feedback; empty: none is at work
  wire::RawWriter cancels_;
  wire::RawReader feedback_;  // last: stops before what it fills is gone
};

}  // namespace

struct LiveSource::Impl {
  explicit Impl(Options given) : options(std::move(given)) {}

  void on_sample(ViewServer& server, int topic, std::span<const std::byte> data) {
    server.send(channel_of(server, topic), clock.at(std::chrono::steady_clock::now()), data);
  }

  int channel_of(ViewServer& server, int topic) {
    const auto place = static_cast<std::size_t>(topic);
    const std::lock_guard lock(mutex);
    if (channels.size() <= place) channels.resize(place + 1, -1);
    if (channels[place] < 0) {
      const bags::Topic described = subscriptions->topic(topic);
      channels[place] = server.add_channel(described, described.qos.latched || described.qos.retained);
    }
    return channels[place];
  }

  Result<void> open(ViewServer& server) {
    // Samples come before there is somebody to ask what they are of.
    const std::lock_guard lock(mutex);
    auto subscriptions_result = bags::Subscriptions::open(
        {.name = "jostle_view",
         .domain = options.domain,
         .role = options.control ? wire::Role::kRobot : wire::Role::kObserver,
         .selection = options.selection,
         .definition = [this](const std::string& type) { return options.messages.definition(type); },
         .on_sample = [this, &server](int topic, std::span<const std::byte> data,
                                      const wire::Origin&) { on_sample(server, topic, data); },
         .on_warning = options.on_warning});
    if (!subscriptions_result) return subscriptions_result.error();
    subscriptions = std::move(subscriptions_result).value();
    return {};
  }

  const Options options;
  const bags::RecordClock clock;
  std::mutex mutex;           // guards channels
  std::vector<int> channels;  // of the server, by topic; -1: none yet
  std::unique_ptr<bags::Subscriptions> subscriptions;
  std::mutex commanding;  // guards commander
  std::unique_ptr<Commander> commander;
};

LiveSource::LiveSource(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
LiveSource::~LiveSource() = default;

Result<void> LiveSource::run(ViewServer& server, std::stop_token stop,
                             const std::function<void(int domain)>& on_ready) {
  if (auto ok = impl_->open(server); !ok) return ok;
  const wire::Participant& participant = impl_->subscriptions->participant();
  if (impl_->options.control) {
    const std::lock_guard lock(impl_->commanding);
    impl_->commander = std::make_unique<Commander>(participant);
    server.set_parameters({{kCancel, false}});
  }
  on_ready(participant.domain());
  common::wait_for(stop);
  {
    const std::lock_guard lock(impl_->commanding);
    impl_->commander.reset();
  }
  impl_->subscriptions->close();  // its threads call on_sample()
  return {};
}

Result<ViewParameters> LiveSource::set(const ViewParameters& wanted) {
  if (!impl_->options.control)
    return invalid("op", "setParameters", "none: what is live has no clock to set, and --control was not given");
  for (const auto& [name, value] : wanted) {
    if (name != kCancel || value != true) return invalid(name, value.dump(), std::string(kCancel) + ": true");
  }
  const std::lock_guard lock(impl_->commanding);
  if (!impl_->commander) return Error{Code::kUnavailable, "the server begins, or ends"};
  if (!wanted.empty()) {
    if (auto ok = impl_->commander->cancel(); !ok) return ok.error();
  }
  return ViewParameters{{kCancel, false}};
}

}  // namespace jostle::tools
