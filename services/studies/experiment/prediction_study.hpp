#pragma once
/// \file
/// Studies of prediction alone: how far Parareal is from the fine model, or from a world
/// that the fine model does not know exactly, after each iteration.

#include <memory>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/api/rollout.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/uncertainty/levels.hpp"
#include "services/studies/experiment/study.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct PredictionStudy {
  enum class Cases {
    kOpenLoop,  ///< Sec. 6.3.2: pushes from points across a slider's side, at some angles
    kExamples,  ///< Fig. 6.5: box and cylinder, pushed at the centre and at the side
    kRandom,    ///< Sec. 7.4: random states and controls that move something
  };
  enum class Measure {
    kFinal,      ///< distance and rotation between the last states
    kPositions,  ///< RMS over the sliders' positions along the trajectory
    kState,      ///< RMS over the sliders' whole states (m, rad, m/s, rad/s)
  };

  StudyAbout about;
  std::vector<std::string> models;  ///< names that make_coarse_model takes; the first one is the thesis's
  Cases cases = Cases::kOpenLoop;
  Measure measure = Measure::kFinal;
  physics_pool::Shape shape = physics_pool::Shape::kBox;
  std::vector<int> sliders{1};  ///< one group of cases each
  std::vector<int> actions{4};
  double duration = 1.0;  ///< Delta_t, s
  double speed = 0.025;   ///< m/s; random controls have at most this
  std::vector<double> angles_deg{0.0};
  int samples = 100;  ///< initial states per group
  std::uint64_t seed = 1;
  std::string integrator = "rk4";  ///< the fine model's
  double time_step = 0.001;        ///< s
  /// Compare with an execution world that is as badly known as this.
  physics_pool::Uncertainty reality = physics_pool::Uncertainty::kNone;
  /// The thesis's numbers by iteration, where it gives them.
  std::vector<double> thesis_trans_mm, thesis_rot_deg;
  std::string remark;  ///< printed below the table
};

/// One prediction to make.
struct PredictionCase {
  std::string group;
  std::size_t scene = 0;             ///< index into PredictionCases::scenes
  physics_pool::RolloutBatch batch;  ///< one sample, no noise
};
struct PredictionCases {
  std::vector<physics_pool::Scene> scenes;
  std::vector<PredictionCase> cases;
};

/// Makes the cases of a study, deterministic in its seed. Random states are drawn until nothing overlaps;
/// whether something moves is seen when they run.
PredictionCases make_cases(const PredictionStudy& study);

/// Reads a study whose file says `study: prediction`; `origin` is that file.
Result<std::unique_ptr<Study>> read_prediction_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
