#include "services/studies/bench/several_hosts.hpp"

#include <optional>
#include <utility>

#include "services/common/process/files.hpp"
#include "services/wire/security/keystore.hpp"

namespace jostle::studies {

Result<void> measure_on_hosts(int count, const common::LinkQuality& quality,
                              const std::function<Result<void>(const common::Hosts&)>& measure) {
  auto hosts_result = common::Hosts::make(count, quality);
  if (!hosts_result) return hosts_result.error();
  const common::Hosts& hosts = **hosts_result;
  std::optional<Result<void>> result;
  hosts.on(1, [&] { result = measure(hosts); });
  return *std::move(result);
}

Result<TemporaryKeystore> TemporaryKeystore::make() {
  auto folder_result = common::make_temporary_folder("bench-keys");
  if (!folder_result) return folder_result.error();
  TemporaryKeystore keys(*folder_result);
  if (auto ok = wire::keystore::create(keys.folder_); !ok) return ok.error();
  for (const wire::Role role : {wire::Role::kRobot, wire::Role::kWorker}) {
    auto ok = wire::keystore::issue(keys.folder_, wire::to_string(role), role, std::chrono::days(1));
    if (!ok) return ok.error();
  }
  return keys;
}

TemporaryKeystore::~TemporaryKeystore() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

}  // namespace jostle::studies
