#include "services/wire/dds/middleware_log.hpp"

#include <fastdds/dds/log/Log.hpp>
#include <map>
#include <memory>
#include <string>

#include "services/common/process/trouble.hpp"
#include "services/wire/limits.hpp"

namespace jostle::wire {
namespace {

using eprosima::fastdds::dds::Log;
using eprosima::fastdds::dds::LogConsumer;

// The middleware calls it from one thread.
class Limited final : public LogConsumer {
 public:
  void Consume(const Log::Entry& entry) override {
    const std::string category = entry.context.category ? entry.context.category : "";
    const auto trouble = troubles_.try_emplace(category, "lines of the middleware").first;
    trouble->second.warn("Fast DDS, {}: {}", category, common::shown(entry.message, limits::kShownError));
  }

 private:
  // By category. Never destroyed: the middleware ends after our log does.
  std::map<std::string, common::Trouble>& troubles_ = *new std::map<std::string, common::Trouble>;
};

}  // namespace

void limit_middleware_log() {
  Log::ClearConsumers();
  Log::RegisterConsumer(std::make_unique<Limited>());
}

}  // namespace jostle::wire
