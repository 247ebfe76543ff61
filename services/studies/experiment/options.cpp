#include "services/studies/experiment/options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <thread>
#include <tuple>

#include "services/studies/experiment/study.hpp"

namespace jostle::studies {

void SeedsOption::add_to(CLI::App& app, std::uint64_t first, std::uint64_t last) {
  app.add_option("--seeds", text_,
                 fmt::format("Seeds of the scenes, such as 1-10, or 7 for one (default: {}-{})", first, last));
}

Result<void> SeedsOption::apply(std::uint64_t& first, std::uint64_t& last) const {
  if (text_.empty()) return {};
  auto seeds_result = parse_seeds(text_);
  if (!seeds_result) return seeds_result.error();
  std::tie(first, last) = *seeds_result;
  return {};
}

void add_timeout_option(CLI::App& app, std::optional<double>& seconds) {
  app.add_option("--timeout", seconds, "Seconds that one run may take (default: the parameters')")
      ->check(CLI::Range(1.0, 1e6));
}

void add_jobs_option(CLI::App& app, int& jobs, const std::string& what) {
  jobs = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
  app.add_option("--jobs", jobs, what)->capture_default_str()->check(CLI::Range(1, 1024));
}

}  // namespace jostle::studies
