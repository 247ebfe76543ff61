#pragma once
/// \file
/// Keystore: the folder from which identities are handed out.

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/wire/security/identity.hpp"
#include "services/wire/security/role.hpp"

/// A keystore stays with whoever decides who may join:
///
///   ca/                 ca.pem, ca.key (mode 0600: who has it, makes identities), crl.pem,
///                       governance.p7s, index.json (all that was ever issued)
///   identities/NAME/    one self-contained identity each, see open_identity(): what is
///                       copied to a host
///
/// Keys are on the curve P-256; certificates are signed with ECDSA and SHA-256.
/// Authority and revocation list are good for ten years, so that no robot stops because
/// nobody renewed a list. All dates begin a day early: clocks differ, and Fast DDS reads
/// dates of permissions in local time.
///
/// Threads  any; calls on one keystore take turns, between processes, too.
/// Errors   kInvalidArgument  a name or a number of days; says got and wanted
///          kNotFound         no keystore there, or no such identity
///          kIo               a file cannot be written; names it
///          kInternal         libcrypto failed
namespace jostle::wire::keystore {

/// How long a keystore is good for, and the most that an identity can have.
inline constexpr std::chrono::days kLifetime{3650};

/// Makes the folder and an authority. kInvalidArgument if something is there already.
Result<void> create(const std::filesystem::path& folder);

/// Makes an identity, valid from yesterday for so many days from now; returns its folder.
/// Fewer than one day gives one that has expired, for tests. A name may be issued
/// again once its certificate expired or was revoked; kInvalidArgument before.
Result<std::filesystem::path> issue(const std::filesystem::path& folder, const std::string& name, Role role,
                                    std::chrono::days validity);

/// Puts every certificate of that name on the revocation list, and the new list into
/// every identity of this keystore; returns the files. Copies on other hosts stay as they are.
/// Running processes go by the list they read when they started.
Result<std::vector<std::filesystem::path>> revoke(const std::filesystem::path& folder, const std::string& name);

enum class State { kValid, kExpired, kRevoked };

/// Returns "valid", "expired" or "revoked".
std::string to_string(State state);

struct Entry {
  std::string name;
  Role role = Role::kServer;
  std::string serial;  ///< the certificate's, hexadecimal
  SystemTime not_after;
  State state = State::kValid;
};

/// Lists all that was ever issued, oldest first.
Result<std::vector<Entry>> list(const std::filesystem::path& folder, SystemTime now = std::chrono::system_clock::now());

}  // namespace jostle::wire::keystore
