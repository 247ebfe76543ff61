#include "services/studies/bench/benchmark.hpp"

#include "services/common/charts/gnuplot.hpp"
#include "services/common/process/files.hpp"

namespace jostle::studies {

Result<void> Benchmark::check_output(const std::string& file) { return common::check_outputs({{"--json", file, {}}}); }

Result<void> Benchmark::check_picture(const std::string& file) {
  if (file.empty()) return {};
  if (auto ok = common::check_picture(file); !ok) return ok;
  return common::check_outputs({{"--plot", file, {}}});
}

}  // namespace jostle::studies
