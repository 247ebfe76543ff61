#include "services/bench/several_hosts.hpp"

#include <optional>
#include <utility>

#include "services/security/keystore.hpp"
#include "services/support/files.hpp"

namespace jostle::services {

Result<Measurements> measure_on_hosts(int count, const LinkQuality& quality,
                                      const std::function<Result<Measurements>(const Hosts&)>& measure) {
  auto hosts_result = Hosts::make(count, quality);
  if (!hosts_result) return hosts_result.error();
  const Hosts& hosts = **hosts_result;
  std::optional<Result<Measurements>> result;
  hosts.on(1, [&] { result = measure(hosts); });
  return *std::move(result);
}

Result<TemporaryKeystore> TemporaryKeystore::make() {
  auto folder_result = make_temporary_folder("bench-keys");
  if (!folder_result) return folder_result.error();
  TemporaryKeystore keys(*folder_result);
  if (auto ok = keystore::create(keys.folder_); !ok) return ok.error();
  for (const security::Role role : {security::Role::kRobot, security::Role::kWorker}) {
    auto ok = keystore::issue(keys.folder_, security::to_string(role), role, std::chrono::days(1));
    if (!ok) return ok.error();
  }
  return keys;
}

TemporaryKeystore::~TemporaryKeystore() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

}  // namespace jostle::services
