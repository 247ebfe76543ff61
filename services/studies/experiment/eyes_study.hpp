#pragma once
/// \file
/// The study of whole runs by who sees the objects.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "idl/types/result.hpp"
#include "services/studies/experiment/study.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct EyesStudy {
  StudyAbout about;
  int objects = 15;
  std::uint64_t first_seed = 1, last_seed = 10;
  std::string arm = "sim";           ///< --arm of `jostle run`
  std::vector<std::string> sensors;  ///< --objects of `jostle run`
};

/// Reads a study whose file says `study: eyes`; `origin` is that file. A case is one scene of generate_chapter3 and one
/// sensor: a `jostle run` with processes of its own, on the domain of ROS_DOMAIN_ID, one at a time. Seeds are in the
/// outer loop, so that whatever part was run compares all sensors on equal scenes.
Result<std::unique_ptr<Study>> read_eyes_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
