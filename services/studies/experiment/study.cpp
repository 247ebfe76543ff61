#include "services/studies/experiment/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <thread>

#include "idl/text/yaml_fields.hpp"
#include "services/common/process/files.hpp"
#include "services/studies/experiment/grasping_study.hpp"
#include "services/studies/experiment/prediction_study.hpp"
#include "services/studies/experiment/push_study.hpp"
#include "services/studies/experiment/timing_study.hpp"

namespace jostle::studies {

Result<std::unique_ptr<Study>> load_study(const std::string& name) {
  const auto file = common::data_file("experiments/" + name + ".yaml");
  auto text_result = common::read_text(file);
  if (!text_result) {
    return Error{Code::kNotFound, fmt::format("experiment: got '{}', wanted one of `jostle experiment "
                                              "list` ({})",
                                              name, text_result.error().message)};
  }
  using Loaded = std::unique_ptr<Study>;
  return yaml::parse<Loaded>(*text_result, file.string(), [&](const YAML::Node& root) -> Result<Loaded> {
    yaml::Fields fields(root, "", file.string());
    auto read = &read_grasping_study;
    fields.choice<decltype(read)>("study", read,
                                  {{"grasping", &read_grasping_study},
                                   {"prediction", &read_prediction_study},
                                   {"push", &read_push_study},
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

std::vector<std::pair<std::string, std::string>> list_studies() {
  std::vector<std::pair<std::string, std::string>> studies;
  std::error_code problem;
  for (const auto& entry : std::filesystem::directory_iterator(common::data_file("experiments"), problem)) {
    if (entry.path().extension() != ".yaml") continue;
    const std::string name = entry.path().stem().string();
    if (auto study_result = load_study(name)) studies.emplace_back(name, (*study_result)->title());
  }
  std::ranges::sort(studies);
  return studies;
}

void run_side_by_side(std::size_t count, int at_a_time, std::stop_token stop,
                      const std::function<void(std::size_t)>& job) {
  std::atomic<std::size_t> next = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < std::max(at_a_time, 1); ++i) {
    threads.emplace_back([&] {
      for (std::size_t mine = next++; mine < count && !stop.stop_requested(); mine = next++) job(mine);
    });
  }
}

}  // namespace jostle::studies
