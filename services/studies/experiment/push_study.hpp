#pragma once
/// \file
/// The studies of Fig. 6.7 and 7.7: pushing in model-predictive control, planned with one
/// predictor after the other.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/uncertainty/levels.hpp"
#include "services/studies/experiment/study.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct PushStudy {
  /// A predictor, and the threads that work for it: one thread for the fine model is
  /// the thesis's serial case, where nothing but time is parallel.
  struct Entry {
    std::string predictor;  ///< a text that Predictor::make takes
    int threads = 1;
  };

  std::string title;
  task::Parameters parameters;
  int chapter = 6;  ///< 6 or 7: scenes of generate_chapter6 or generate_chapter7
  physics_pool::Shape shape = physics_pool::Shape::kCylinder;
  int objects = 3;  ///< sliders beside the target, Chapter 7
  std::uint64_t first_seed = 1, last_seed = 20;
  /// How badly the planner knows the world it acts in.
  physics_pool::Uncertainty reality = physics_pool::Uncertainty::kNone;
  std::vector<Entry> entries;
  std::string remark;  ///< printed below the table
};

/// One scene, planned and pushed once.
struct PushRun {
  std::uint64_t seed = 0;
  std::size_t entry = 0;
  std::string error;  ///< not empty if the system itself failed
  planners::Outcome outcome;
};

/// Runs every combination, one at a time unless told otherwise, because times are measured.
/// Scenes are in the outer loop, so that what slows the machine slows all predictors.
std::vector<PushRun> run_study(const PushStudy& study, const StudyOptions& options,
                               const std::function<void(const PushRun&)>& on_run);

/// Reads a study whose file says `study: push`; `origin` is that file.
Result<std::unique_ptr<Study>> read_push_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
