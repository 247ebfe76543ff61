#pragma once
/// \file
/// Identity: who this process is on a protected DDS domain.

#include <chrono>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/result.hpp"
#include "services/wire/security/role.hpp"

namespace jostle::wire {

using SystemTime = std::chrono::system_clock::time_point;

struct Identity {
  std::string name;
  std::string subject;  ///< RFC 2253, such as CN=arm,OU=robot,O=Jostle
  Role role = Role::kServer;
  Rights rights;         ///< what its permissions say, whatever the role
  SystemTime not_after;  ///< end of certificate and permissions
  /// DDS Security properties, name and value, that a participant is made with.
  std::vector<std::pair<std::string, std::string>> properties;
};

/// Reads an identity folder, as a keystore issues it, and checks all that Fast DDS
/// checks: given a wrong file, it creates no participant and mostly says nothing.
///
/// The folder holds
///
///   ca.pem           certificate of the authority that everybody trusts
///   cert.pem         this identity's certificate, signed by it
///   key.pem          its private key, nobody else's business
///   governance.p7s   how much a domain protects      signed by the authority
///   permissions.p7s  what this identity may do       signed by the authority
///   crl.pem          revoked certificates            signed by the authority
///
/// Time     the wall clock, like Fast DDS. It reads dates of permissions in the local time of
///          the machine: away from UTC they end up to 14 hours before or after the certificate.
/// Errors   kNotFound         the folder or a file of it is missing, or cannot be read
///          kInvalidArgument  a file is none, or does not fit the others, or its time is over
///          kInternal         libcrypto failed
///          Messages say the file, what was got, what was wanted, and the remedy.
Result<Identity> open_identity(const std::filesystem::path& folder, SystemTime now = std::chrono::system_clock::now());

}  // namespace jostle::wire
