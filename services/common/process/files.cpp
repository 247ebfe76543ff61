#include "services/common/process/files.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "services/common/process/program.hpp"

namespace jostle::common {

namespace fs = std::filesystem;

fs::path program_folder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

fs::path share_folder(const fs::path& programs) {
  const fs::path beside = programs.parent_path() / "share" / "jostle";
  std::error_code ignored;
  for (fs::path prefix = programs.parent_path();; prefix = prefix.parent_path()) {
    if (fs::is_directory(prefix / "share" / "jostle", ignored)) return prefix / "share" / "jostle";
    if (prefix == prefix.parent_path()) return beside;  // the root: there is none
  }
}

fs::path data_file(const std::string& name) { return share_folder(program_folder()) / name; }

std::string coarse_model_name(const std::string& name) {
  return name == "learned" ? "learned:" + data_file("models/coarse-sliders.net").string() : name;
}

Result<std::string> read_text(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) {
    return Error{Code::kIo, fmt::format("{}: cannot be read", file.string())};
  }
  return text.str();
}

Result<void> write_text(const fs::path& file, const std::string& text) {
  std::error_code ignored;
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), ignored);
  const fs::path draft = file.string() + fmt::format(".{}", ::getpid());
  std::ofstream out(draft);
  out << text;
  out.close();
  std::error_code problem;
  if (out) fs::rename(draft, file, problem);
  if (out && !problem) return {};
  fs::remove(draft, ignored);
  return Error{Code::kIo,
               fmt::format("{}: cannot be written{}", file.string(), problem ? ": " + problem.message() : "")};
}

Result<fs::path> make_temporary_folder(const std::string& purpose) {
  std::error_code problem;
  const fs::path parent = fs::temp_directory_path(problem);
  if (problem) return Error{Code::kIo, fmt::format("TMPDIR: got '{}', wanted a folder", parent.string())};
  std::string name = (parent / fmt::format("jostle-{}-XXXXXX", purpose)).string();
  if (mkdtemp(name.data())) {
    remove_at_abrupt_end(name);
    return fs::path(name);
  }
  return Error{Code::kIo, fmt::format("{}: cannot be made: {}", name, std::strerror(errno))};
}

}  // namespace jostle::common
