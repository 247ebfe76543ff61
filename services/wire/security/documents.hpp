#pragma once
/// \file
/// The two texts of DDS Security that a CA signs: governance, which says how
/// much a domain protects, and permissions, which say who may do what.
/// For the .cpp files of this room, and for tests.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/wire/security/pki.hpp"
#include "services/wire/security/role.hpp"

namespace jostle::wire {

/// Returns the governance of all domains and topics: strangers are refused, everything is encrypted.
///
/// Source  OMG DDS Security 1.1, 9.4.1.2. Per message: rtps SIGN authenticates the
///         whole packet; metadata ENCRYPT hides sequence numbers and headers of
///         submessages; data ENCRYPT hides the sample itself. rtps ENCRYPT would
///         encrypt for a third time what is hidden already.
std::string governance_text();

/// What one grant of a permissions text says.
struct Grant {
  std::string subject;  ///< RFC 2253, such as CN=arm,OU=robot,O=Jostle
  Period validity;
  Rights rights;
};

std::string permissions_text(const Grant& grant);

/// Errors   kInvalidArgument  no such text; says the file and the place
Result<std::vector<Grant>> parse_permissions(const std::filesystem::path& file, const std::string& text);
Result<void> check_governance(const std::filesystem::path& file, const std::string& text);

/// Whether Fast DDS takes two subjects for the same: equal parts in equal order,
/// whatever blanks are around them.
bool same_subject(const std::string& a, const std::string& b);
/// Whether two subjects have the same parts, in whatever order.
bool same_parts(const std::string& a, const std::string& b);

}  // namespace jostle::wire
