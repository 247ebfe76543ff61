#include "services/tools/view/live_source.hpp"

#include <chrono>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "services/bags/listening/record_clock.hpp"
#include "services/bags/listening/subscriptions.hpp"

namespace jostle::tools {

struct LiveSource::Impl {
  explicit Impl(ViewServer& shown_on) : server(shown_on) {}
  ~Impl() {
    if (subscriptions) subscriptions->close();  // its threads call on_sample()
  }

  void on_sample(int topic, std::span<const std::byte> data) {
    server.send(channel_of(topic), clock.at(std::chrono::steady_clock::now()), data);
  }

  int channel_of(int topic) {
    const auto place = static_cast<std::size_t>(topic);
    const std::lock_guard lock(mutex);
    if (channels.size() <= place) channels.resize(place + 1, -1);
    if (channels[place] < 0) {
      const bags::Topic described = subscriptions->topic(topic);
      channels[place] = server.add_channel(described, described.qos.latched || described.qos.retained);
    }
    return channels[place];
  }

  ViewServer& server;
  const bags::RecordClock clock;
  std::mutex mutex;           // guards channels
  std::vector<int> channels;  // of the server, by topic; -1: none yet
  std::unique_ptr<bags::Subscriptions> subscriptions;
};

Result<std::unique_ptr<LiveSource>> LiveSource::open(Options options, ViewServer& server) {
  auto impl = std::make_unique<Impl>(server);
  // Samples come before there is somebody to ask what they are of.
  const std::lock_guard lock(impl->mutex);
  auto subscriptions_result = bags::Subscriptions::open(
      {.name = "jostle_view",
       .domain = options.domain,
       .selection = std::move(options.selection),
       .definition = [messages =
                          std::move(options.messages)](const std::string& type) { return messages.definition(type); },
       .on_sample = [impl = impl.get()](int topic, std::span<const std::byte> data,
                                        const wire::Origin&) { impl->on_sample(topic, data); },
       .on_warning = std::move(options.on_warning)});
  if (!subscriptions_result) return subscriptions_result.error();
  impl->subscriptions = std::move(subscriptions_result).value();
  return std::unique_ptr<LiveSource>(new LiveSource(std::move(impl)));
}

LiveSource::LiveSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LiveSource::~LiveSource() = default;

int LiveSource::domain() const { return impl_->subscriptions->participant().domain(); }
int LiveSource::topics() const { return impl_->subscriptions->topics(); }

}  // namespace jostle::tools
