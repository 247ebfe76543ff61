#pragma once
/// \file
/// Identities that no keystore would make, and a keystore for one test.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "services/wire/security/documents.hpp"
#include "services/wire/security/keystore.hpp"
#include "services/wire/security/pki.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {

/// Value of a result that must be one.
template <class T>
T sure(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(result).value();
}

inline void overwrite(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::trunc) << text;
}

/// A keystore in a folder of its own, and what an insider could do with it.
class Lab {
 public:
  explicit Lab(const std::filesystem::path& folder) : folder_(folder) {
    const auto ok = wire::keystore::create(folder_);
    if (!ok) throw std::runtime_error(ok.error().message);
  }

  const std::filesystem::path& folder() const { return folder_; }

  std::filesystem::path issue(const std::string& name, wire::Role role, int days = 30) const {
    return sure(wire::keystore::issue(folder_, name, role, std::chrono::days(days)));
  }

  wire::Authority authority() const {
    return {sure(wire::load_certificate(folder_ / "ca" / "ca.pem")), sure(wire::load_key(folder_ / "ca" / "ca.key"))};
  }

  std::string signed_by_authority(const std::string& text) const {
    const wire::Authority signer = authority();
    return wire::sign_text(*signer.certificate, *signer.key, text);
  }

 private:
  std::filesystem::path folder_;
};

/// Subject of an identity's certificate.
inline std::string subject_of(const std::filesystem::path& identity) {
  return wire::name_of(X509_get_subject_name(sure(wire::load_certificate(identity / "cert.pem")).get()));
}

/// Permissions for everything, from yesterday until in a month.
inline wire::Grant full_grant(const std::string& subject) {
  constexpr std::time_t kDay = 86'400;
  const std::time_t now = std::time(nullptr);
  return {
      .subject = subject, .validity = {now - 2 * kDay, now + 30 * kDay}, .rights = wire::rights_of(wire::Role::kRobot)};
}

}  // namespace jostle::tests
