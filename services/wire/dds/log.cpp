#include "services/wire/dds/log.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <fastdds/dds/log/Log.hpp>
#include <memory>

namespace jostle::wire {
namespace {

using eprosima::fastdds::dds::Log;

class PlainLines final : public eprosima::fastdds::dds::LogConsumer {
 public:
  void Consume(const Log::Entry& entry) override {
    const char* category = entry.context.category ? entry.context.category : "";
    fmt::print(stderr, "{}: Fast DDS: {}: {}\n", program_invocation_short_name, category, entry.message);
  }
};

}  // namespace

void log_in_plain_lines() {
  Log::ClearConsumers();
  Log::RegisterConsumer(std::make_unique<PlainLines>());
}

}  // namespace jostle::wire
