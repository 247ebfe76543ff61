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
  std::string version;  ///< of Jostle
  std::string types;    ///< hash of all wire types
  int domain = 0;
  std::string discovery;  ///< as --discovery has it
  std::string identity;   ///< name and role; empty: unprotected
  std::string authority;  ///< hash of the certificate that its keystore signs with
  std::vector<Check> checks;
};

/// Of this process and its environment.
Facts facts_of(int domain, std::vector<Check> checks);

nlohmann::json to_json(const Facts& facts);
/// Error kInvalidArgument: another doctor's facts are no such.
Result<Facts> parse_facts(const nlohmann::json& facts);

nlohmann::json to_json(const std::vector<Check>& checks);

/// Nanoseconds since 1970 by the wall clock, whose agreement is one of the checks.
std::int64_t wall_clock_ns();

/// The same on both sides: `text`, filled up to at most as many bytes as UDP carries.
std::string test_datagram(const std::string& text, std::size_t bytes);

}  // namespace jostle::tools
