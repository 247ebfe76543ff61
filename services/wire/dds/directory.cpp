#include "services/wire/dds/directory.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <climits>
#include <ranges>
#include <string>
#include <string_view>

#include "idl/types/number.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/core.hpp"
#include "services/wire/limits.hpp"

namespace jostle::wire {
namespace {

// The value of a key in "key=value;key=value;"; empty if it is not there.
std::string value_of(std::string_view key, std::string_view text) {
  for (const auto part : text | std::views::split(';')) {
    const std::string_view entry(part.begin(), part.end());
    if (entry.size() > key.size() && entry.starts_with(key) && entry[key.size()] == '=')
      return std::string(entry.substr(key.size() + 1));
  }
  return "";
}

}  // namespace

void introduce(eprosima::fastdds::dds::DomainParticipantQos& qos) {
  char host[HOST_NAME_MAX + 1] = "";
  gethostname(host, sizeof host - 1);
  const std::string text = fmt::format("host={};pid={};", host, getpid());
  qos.user_data().data_vec({text.begin(), text.end()});
}

void Directory::add(const eprosima::fastrtps::rtps::ParticipantProxyData& data) {
  const auto& bytes = data.m_userData.data_vec();
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 1024));
  const std::string_view name(data.m_participantName.c_str());
  ParticipantInfo info{.name = common::shown(name, limits::kShown),
                       .host = common::shown(value_of("host", text), limits::kShown),
                       .pid = parse_whole<std::uint32_t>(value_of("pid", text), 0, UINT32_MAX).value_or(0)};
  const std::lock_guard lock(mutex_);
  participants_.insert_or_assign(participant_id(data.m_guid), std::move(info));
}

void Directory::remove(const eprosima::fastrtps::rtps::GUID_t& guid) {
  const std::lock_guard lock(mutex_);
  participants_.erase(participant_id(guid));
}

std::optional<ParticipantInfo> Directory::find(std::uint64_t id) const {
  const std::lock_guard lock(mutex_);
  const auto found = participants_.find(id);
  if (found == participants_.end()) return {};
  return found->second;
}

}  // namespace jostle::wire
