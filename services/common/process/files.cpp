#include "services/common/process/files.hpp"

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

Result<std::string> read_text(const fs::path& file) { return files::read(file); }

Result<void> write_text(const fs::path& file, const std::string& text) { return files::write(file, text); }

Result<void> check_outputs(const std::vector<files::Output>& outputs) { return files::check_outputs(outputs); }

}  // namespace jostle::common
