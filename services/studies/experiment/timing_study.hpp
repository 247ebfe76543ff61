#pragma once
/// \file
/// The study of Fig. 6.6: how long a prediction takes, per number of iterations.

#include <memory>
#include <string>

#include "idl/text/yaml_fields.hpp"
#include "services/studies/experiment/study.hpp"

namespace jostle::studies {

/// Reads a study whose file says `study: timing`: the box pushed at its side (Fig. 6.5), predicted again and again by
/// the serial fine model and by Parareal with 1 … N iterations on all processors, beside
/// what Eq. 6.4 expects of c_c and c_f measured before.
Result<std::unique_ptr<Study>> read_timing_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
