#include "services/common/charts/gnuplot.hpp"

#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"

namespace jostle::common {

namespace fs = std::filesystem;

std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("''") : std::string(1, c == '\n' ? ' ' : c);
  return result + "'";
}

Result<void> run_gnuplot(const fs::path& picture, const std::string& script) {
  auto folder_result = make_temporary_folder("plot");
  if (!folder_result) return folder_result.error();
  const fs::path& folder = *folder_result;
  std::error_code ignored;
  if (picture.has_parent_path()) fs::create_directories(picture.parent_path(), ignored);
  auto drawn = write_text(folder / "plot.gp", script);
  if (drawn) drawn = run_tool("gnuplot", "gnuplot-nox", {(folder / "plot.gp").string()}, folder / "log");
  fs::remove_all(folder, ignored);
  return drawn;
}

}  // namespace jostle::common
