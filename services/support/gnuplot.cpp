#include "services/support/gnuplot.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <sstream>

#include "services/support/child_process.hpp"
#include "services/support/files.hpp"

namespace jostle::services {
namespace {

namespace fs = std::filesystem;

Result<fs::path> find_gnuplot() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder) / "gnuplot";
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  return Error{Code::kNotFound, "gnuplot: not found on PATH; install the package gnuplot-nox"};
}

Result<void> run(const fs::path& gnuplot, const fs::path& folder, const std::string& script) {
  if (auto ok = write_text(folder / "plot.gp", script); !ok) return ok;
  auto child_result = ChildProcess::start(gnuplot, {(folder / "plot.gp").string()}, folder / "log");
  if (!child_result) return child_result.error();
  const std::string end = child_result->wait();
  if (end == "exit code 0") return {};
  return Error{Code::kIo, fmt::format("gnuplot: {}\n{}", end, child_result->last_words())};
}

}  // namespace

std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("''") : std::string(1, c == '\n' ? ' ' : c);
  return result + "'";
}

Result<void> run_gnuplot(const fs::path& picture, const std::string& script) {
  auto gnuplot_result = find_gnuplot();
  if (!gnuplot_result) return gnuplot_result.error();
  auto folder_result = make_temporary_folder("plot");
  if (!folder_result) return folder_result.error();
  std::error_code ignored;
  if (picture.has_parent_path()) fs::create_directories(picture.parent_path(), ignored);
  auto drawn = run(*gnuplot_result, *folder_result, script);
  fs::remove_all(*folder_result, ignored);
  return drawn;
}

}  // namespace jostle::services
