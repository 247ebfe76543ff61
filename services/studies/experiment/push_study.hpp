#pragma once
/// \file
/// The studies of Fig. 6.7 and 7.7: pushing in model-predictive control, planned with one
/// predictor after the other.

#include <cstdint>
#include <memory>
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

  StudyAbout about;
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

/// Reads a study whose file says `study: push`; `origin` is that file. A case is one scene pushed with one predictor.
/// They run one at a time, because times are measured; scenes are in the outer loop, so that what slows the
/// machine slows all predictors.
Result<std::unique_ptr<Study>> read_push_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
