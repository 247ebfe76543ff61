#pragma once
/// \file
/// The study of Fig. 4.4: reaching in a shelf with the five methods of Chapter 4, in worlds that planners do not know.

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/uncertainty/realizations.hpp"
#include "services/studies/experiment/study.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct RobustStudy {
  StudyAbout about;
  task::Parameters parameters;
  std::vector<std::string> methods;  ///< names of controllers
  std::uint64_t first_seed = 1001, last_seed = 1030;
  physics_pool::ParameterBounds bounds;       ///< of the worlds that plans are executed in
  physics_pool::StartSpread spread;           ///< how far objects are in them from where they are believed to be
  std::map<std::string, std::string> thesis;  ///< by method: what the thesis says
  std::string remark;                         ///< printed below the table
};

/// Reads a study whose file says `study: robust`; `origin` is that file. A case is one scene of generate_chapter4 with
/// one method. The scene is what is believed; what is executed in is a realization of it, drawn by seeds that no
/// planner uses. Seeds are in the outer loop, so that whatever part was run compares all methods on equal scenes and
/// worlds. No clock decides.
Result<std::unique_ptr<Study>> read_robust_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
