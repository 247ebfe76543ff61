#include "services/studies/experiment/options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
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

void read_seeds(yaml::Fields& fields, std::uint64_t& first, std::uint64_t& last) {
  fields.section("seeds", true, [&](yaml::Fields& seeds) {
    seeds.required("first", first);
    seeds.required("last", last);
  });
}

Result<task::Parameters> parameters_beside(const std::string& origin, const std::string& file) {
  return task::load_parameters(std::filesystem::path(origin).parent_path() / file);
}

Result<void> check_methods(const std::vector<std::string>& methods, const std::string& where) {
  const std::vector<std::string> known = planners::controller_names();
  for (const std::string& method : methods) {
    if (std::ranges::find(known, method) == known.end())
      return invalid(where, "'" + method + "'", fmt::format("{}", fmt::join(known, ", ")));
  }
  return methods.empty() ? Result<void>(invalid(where, "an empty list", "at least one")) : Result<void>();
}

}  // namespace jostle::studies
