#pragma once
/// \file
/// Where programs find what lies beside them, and how they read and write files.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/files/files.hpp"
#include "idl/types/result.hpp"
#include "services/common/process/temporary_folder.hpp"

namespace jostle::common {

/// Returns the folder this program was started from, links resolved.
std::filesystem::path program_folder();

/// Returns where data of the programs in a folder lie: share/jostle of the nearest folder
/// above that has one. Programs in build/bin find build/share/jostle, those in
/// /usr/libexec/jostle find /usr/share/jostle. If there is none, it is the one that
/// would lie beside, for a message to name.
std::filesystem::path share_folder(const std::filesystem::path& programs);

/// Returns a data file of the project, `name` such as "experiments/chapter3.yaml", in the
/// share folder of this program.
std::filesystem::path data_file(const std::string& name);

/// Turns a coarse model's name into one for make_coarse_model: `learned` alone means the network that
/// comes along, models/coarse-sliders.net.
std::string coarse_model_name(const std::string& name);

/// See idl/files/files.hpp, also for `-`, pipes, devices and links.
Result<std::string> read_text(const std::filesystem::path& file);
Result<void> write_text(const std::filesystem::path& file, const std::string& text);
Result<void> check_outputs(const std::vector<files::Output>& outputs);

}  // namespace jostle::common
