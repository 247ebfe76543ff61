#pragma once
/// \file
/// What a doctor tells another one about its machine.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/tools/doctor/check.hpp"

namespace jostle::tools {

struct Facts {
  std::string host;
  std::string version;  ///< Jostle's
  std::string types;    ///< hash of all wire types
  int domain = 0;
  std::string discovery;  ///< as --discovery has it
  std::string identity;   ///< name and role; empty: unprotected
  std::string authority;  ///< hash of the certificate that its keystore signs with
  std::vector<Check> checks;
};

/// Collects the facts of this process and its environment.
Facts facts_of(int domain, std::vector<Check> checks);

nlohmann::json to_json(const Facts& facts);
/// Reads another doctor's facts. Error kInvalidArgument: they are none.
Result<Facts> parse_facts(const nlohmann::json& facts);

nlohmann::json to_json(const std::vector<Check>& checks);

/// Returns nanoseconds since 1970 by the wall clock. That both hosts' clocks agree is one of the checks.
std::int64_t wall_clock_ns();

/// Makes a datagram of `text`, the same on both sides: filled up to `bytes`, or to as many as UDP carries.
std::string test_datagram(const std::string& text, std::size_t bytes);

}  // namespace jostle::tools
