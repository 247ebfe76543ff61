#include "services/studies/experiment/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "services/common/process/files.hpp"
#include "services/studies/experiment/adaptive_study.hpp"
#include "services/studies/experiment/eyes_study.hpp"
#include "services/studies/experiment/grasping_study.hpp"
#include "services/studies/experiment/prediction_study.hpp"
#include "services/studies/experiment/push_study.hpp"
#include "services/studies/experiment/robust_study.hpp"
#include "services/studies/experiment/timing_study.hpp"

namespace jostle::studies {

std::vector<common::Panel> Study::figure(const nlohmann::json&) const { return {}; }

StudyAbout read_about(yaml::Fields& fields) {
  StudyAbout about;
  fields.required("title", about.title);
  fields.optional("purpose", about.purpose);
  fields.optional("takes", about.takes);
  return about;
}

Result<std::unique_ptr<Study>> load_study(const std::string& name) {
  const auto file = common::data_file("experiments/" + name + ".yaml");
  auto text_result = common::read_text(file);
  if (!text_result) {
    return Error{Code::kNotFound, fmt::format("study: got '{}', wanted one of `jostle experiment "
                                              "list` ({})",
                                              name, text_result.error().message)};
  }
  using Loaded = std::unique_ptr<Study>;
  return yaml::parse<Loaded>(*text_result, file.string(), [&](const YAML::Node& root) -> Result<Loaded> {
    yaml::Fields fields(root, "", file.string());
    auto read = &read_grasping_study;
    fields.choice<decltype(read)>("study", read,
                                  {{"adaptive", &read_adaptive_study},
                                   {"eyes", &read_eyes_study},
                                   {"grasping", &read_grasping_study},
                                   {"prediction", &read_prediction_study},
                                   {"push", &read_push_study},
                                   {"robust", &read_robust_study},
                                   {"timing", &read_timing_study}});
    if (!root["study"]) {
      return Error{Code::kInvalidArgument, fmt::format("{}: study: missing, wanted a kind of study: these are "
                                                       "parameters",
                                                       file.string())};
    }
    auto study_result = read(fields, file.string());
    fields.finish();
    return study_result;
  });
}

Result<std::map<std::string, std::string>> study_files(const std::string& name) {
  std::map<std::string, std::string> files;
  const auto add = [&](const std::string& file) -> Result<void> {
    auto text_result = common::read_text(common::data_file("experiments/" + file));
    if (!text_result) return text_result.error();
    files[file] = std::move(text_result).value();
    return {};
  };
  const std::string own = name + ".yaml";
  if (auto ok = add(own); !ok) return ok.error();
  if (const YAML::Node parameters = YAML::Load(files[own])["parameters"]; parameters && parameters.IsScalar()) {
    if (auto ok = add(parameters.Scalar()); !ok) return ok.error();
  }
  return files;
}

std::vector<std::pair<std::string, std::unique_ptr<Study>>> load_studies() {
  std::vector<std::pair<std::string, std::unique_ptr<Study>>> studies;
  std::error_code problem;
  for (const auto& entry : std::filesystem::directory_iterator(common::data_file("experiments"), problem)) {
    if (entry.path().extension() != ".yaml") continue;
    const std::string name = entry.path().stem().string();
    if (auto study_result = load_study(name)) studies.emplace_back(name, std::move(study_result).value());
  }
  std::ranges::sort(studies, {}, [](const auto& study) { return study.first; });
  return studies;
}

Result<std::pair<std::uint64_t, std::uint64_t>> parse_seeds(const std::string& text) {
  unsigned long long first = 0, last = 0;
  char rest = 0;
  const int found = std::sscanf(text.c_str(), "%llu-%llu%c", &first, &last, &rest);
  if (found == 1) last = first;
  // One that begins with a sign would be a huge number.
  const bool is_number = !text.empty() && text.front() >= '0' && text.front() <= '9';
  if (!is_number || (found != 1 && found != 2) || last < first ||
      (found == 1 && text.find_first_not_of("0123456789") != std::string::npos)) {
    return Error{Code::kInvalidArgument,
                 fmt::format("--seeds: got '{}', wanted a number or a range such as 1-10", text)};
  }
  return std::pair<std::uint64_t, std::uint64_t>(first, last);
}

}  // namespace jostle::studies
