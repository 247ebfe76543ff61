#pragma once
/// \file
/// Where programs find what lies beside them.

#include <filesystem>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::services {

/// The folder this program was started from, links resolved.
std::filesystem::path program_folder();

/// A data file of the project, `name` such as "experiments/chapter3.yaml":
/// looked for below ../share/jostle of the program's folder.
std::filesystem::path data_file(const std::string& name);

/// A coarse model's name for make_coarse_model: `learned` alone means the network that
/// comes along, models/coarse-sliders.net.
std::string coarse_model_name(const std::string& name);

/// Error kIo naming the file.
Result<std::string> read_text(const std::filesystem::path& file);

/// Makes missing folders; replaces the file in one step, so that a reader
/// never sees half of it. Error kIo naming the file.
Result<void> write_text(const std::filesystem::path& file, const std::string& text);

/// A new folder that only this user can read, for its caller to remove; `purpose`
/// becomes part of its name. Error kIo naming it.
Result<std::filesystem::path> make_temporary_folder(const std::string& purpose);

}  // namespace jostle::services
