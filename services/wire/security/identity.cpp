#include "services/wire/security/identity.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/x509_vfy.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <optional>

#include "services/wire/security/documents.hpp"
#include "services/wire/security/pki.hpp"

namespace jostle::wire {
namespace {

namespace fs = std::filesystem;

constexpr const char* kIssueAgain = "remedy: `jostle keys issue` it again, and copy the whole folder to its host";
constexpr const char* kCopyAgain = "remedy: copy the whole folder from the keystore again";
constexpr const char* kCheckClock = "remedy: set this machine's clock";

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

Error wrong(const fs::path& file, const std::string& got, const std::string& wanted, const std::string& remedy) {
  return {Code::kInvalidArgument, fmt::format("{}: got {}, wanted {}; {}", file.string(), got, wanted, remedy)};
}

Error with_remedy(Error error, const char* remedy) {
  error.message += fmt::format("; {}", remedy);
  return error;
}

std::string identities_below(const fs::path& keystore) {
  std::vector<std::string> folders;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(keystore / "identities", ignored)) {
    if (is_there(entry.path() / "cert.pem")) folders.push_back(entry.path().string());
  }
  std::ranges::sort(folders);
  return folders.empty() ? "none yet, see `jostle keys issue`" : fmt::format("{}", fmt::join(folders, ", "));
}

// The keystore that somebody gave us a folder of, instead of one of its identities.
std::optional<fs::path> keystore_around(const fs::path& folder) {
  for (const fs::path& keystore : {folder, folder.parent_path()}) {
    if (is_there(keystore / "ca" / "ca.pem") && (keystore == folder || !is_there(folder / "cert.pem"))) return keystore;
  }
  return {};
}

Result<void> check_folder(const fs::path& folder) {
  if (!is_there(folder)) {
    return Error{Code::kNotFound, fmt::format("{}: missing, wanted an identity folder; remedy: `jostle keys issue` "
                                              "makes them in KEYSTORE/identities",
                                              folder.string())};
  }
  if (const auto keystore = keystore_around(folder)) {
    return wrong(folder, fmt::format("a folder of the keystore {}", keystore->string()), "an identity's",
                 "remedy: give one of its identities: " + identities_below(*keystore));
  }
  std::error_code ignored;
  if (fs::is_directory(folder, ignored)) return {};
  return wrong(folder, "a file", "an identity folder", "remedy: give the folder that holds cert.pem and key.pem");
}

std::string period_text(const Period& period) {
  return fmt::format("{} to {}", date_text(period.not_before), date_text(period.not_after));
}

Result<void> check_period(const fs::path& file, const char* what, const Period& period, std::time_t now,
                          const char* remedy_when_over) {
  const std::string got = fmt::format("{} for {}", what, period_text(period));
  const std::string wanted = fmt::format("one for now, {}", date_text(now));
  if (now < period.not_before) return wrong(file, got + ", not yet valid", wanted, kCheckClock);
  if (now > period.not_after) return wrong(file, got + ", expired", wanted, remedy_when_over);
  return {};
}

Result<void> check_authority(const fs::path& file, X509& authority, std::time_t now) {
  if (X509_check_ca(&authority) != 1 || X509_self_signed(&authority, 1) != 1) {
    return wrong(file, fmt::format("the certificate of '{}'", name_of(X509_get_subject_name(&authority))),
                 "the self-signed one of a certificate authority", kCopyAgain);
  }
  return check_period(file, "an authority's certificate", period_of(authority), now,
                      "remedy: make a new keystore with `jostle keys init` and hand out its identities");
}

Result<void> check_certificate(const fs::path& file, X509& certificate, X509& authority, std::time_t now) {
  if (X509_verify(&certificate, X509_get0_pubkey(&authority)) != 1 ||
      X509_check_issued(&authority, &certificate) != X509_V_OK) {
    return wrong(file, fmt::format("a certificate by '{}'", name_of(X509_get_issuer_name(&certificate))),
                 fmt::format("one by '{}' of ca.pem", name_of(X509_get_subject_name(&authority))),
                 "remedy: take every file of a folder from one keystore");
  }
  return check_period(file, "a certificate", period_of(certificate), now, kIssueAgain);
}

Result<void> check_revocations(const fs::path& file, X509_CRL& list, X509& authority, std::time_t now) {
  if (X509_CRL_verify(&list, X509_get0_pubkey(&authority)) != 1) {
    return wrong(file,
                 fmt::format("a revocation list by '{}' with a signature that does not fit",
                             name_of(X509_CRL_get_issuer(&list))),
                 fmt::format("one by '{}' of ca.pem", name_of(X509_get_subject_name(&authority))), kCopyAgain);
  }
  const Period period{.not_before = time_of(X509_CRL_get0_lastUpdate(&list)),
                      .not_after = time_of(X509_CRL_get0_nextUpdate(&list))};
  return check_period(file, "a revocation list", period, now,
                      "remedy: copy crl.pem from the keystore again, where every `jostle keys revoke` renews it");
}

Result<void> check_not_revoked(const fs::path& file, X509_CRL& list, X509& certificate) {
  X509_REVOKED* entry = nullptr;
  if (X509_CRL_get0_by_cert(&list, &entry, &certificate) != 1) return {};
  return wrong(file,
               fmt::format("the certificate {} of '{}', revoked on {}", serial_of(certificate),
                           name_of(X509_get_subject_name(&certificate)),
                           date_text(time_of(X509_REVOKED_get0_revocationDate(entry)))),
               "one that crl.pem does not name", kIssueAgain);
}

// Whatever was not asked by name: Fast DDS's own two questions.
Result<void> check_as_fastdds_does(const fs::path& folder, X509& certificate, X509& authority, X509_CRL& list,
                                   std::time_t now) {
  const std::unique_ptr<X509_STORE, FreedBy<X509_STORE_free>> store(X509_STORE_new());
  if (!store || !X509_STORE_add_cert(store.get(), &authority) || !X509_STORE_add_crl(store.get(), &list)) {
    throw CryptoError("libcrypto: store");
  }
  const auto verify = [&](const char* file, X509& subject, unsigned long flags) -> Result<void> {
    const std::unique_ptr<X509_STORE_CTX, FreedBy<X509_STORE_CTX_free>> context(X509_STORE_CTX_new());
    if (!context || !X509_STORE_CTX_init(context.get(), store.get(), &subject, nullptr)) {
      throw CryptoError("libcrypto: verification");
    }
    X509_STORE_CTX_set_time(context.get(), 0, now);
    X509_STORE_CTX_set_flags(context.get(), flags | X509_V_FLAG_CHECK_SS_SIGNATURE | X509_V_FLAG_POLICY_CHECK);
    if (X509_verify_cert(context.get()) == 1) return {};
    return wrong(folder / file,
                 fmt::format("'{}', refused: {}", name_of(X509_get_subject_name(&subject)),
                             X509_verify_cert_error_string(X509_STORE_CTX_get_error(context.get()))),
                 "a certificate that verifies", kIssueAgain);
  };
  if (auto ok = verify("ca.pem", authority, X509_V_FLAG_X509_STRICT); !ok) return ok;
  return verify("cert.pem", certificate, X509_V_FLAG_CRL_CHECK);
}

Result<Grant> find_grant(const fs::path& file, const std::vector<Grant>& grants, const std::string& subject,
                         std::time_t now) {
  const Grant* found = nullptr;
  for (const Grant& grant : grants) {
    if (!same_subject(grant.subject, subject)) continue;
    found = &grant;
    if (check_period(file, "", grant.validity, now, "")) return grant;
  }
  if (found) return check_period(file, "permissions", found->validity, now, kIssueAgain).error();
  const std::string& got = grants.front().subject;
  return wrong(file, fmt::format("subject_name '{}'", got),
               fmt::format("the subject of cert.pem in the order of RFC 2253, '{}'", subject),
               same_parts(got, subject)
                   ? "the parts are right, their order is not: Fast DDS compares them one by one; remedy: sign it with "
                     "the wanted subject_name"
                   : "these are another identity's permissions; remedy: copy the whole folder from the keystore again");
}

Result<Role> role_of(const fs::path& file, X509& certificate) {
  const std::string unit = part_of(X509_get_subject_name(&certificate), NID_organizationalUnitName);
  if (const auto role = parse_role(unit)) return *role;
  return wrong(file, fmt::format("role (OU) '{}'", unit), "robot, worker, observer or server", kIssueAgain);
}

std::vector<std::pair<std::string, std::string>> properties_of(const fs::path& folder) {
  const auto uri = [&](const char* file) { return "file://" + (folder / file).string(); };
  const std::string authentication = "dds.sec.auth.builtin.PKI-DH.",
                    access = "dds.sec.access.builtin.Access-Permissions.";
  return {{"dds.sec.auth.plugin", "builtin.PKI-DH"},
          {authentication + "identity_ca", uri("ca.pem")},
          {authentication + "identity_certificate", uri("cert.pem")},
          {authentication + "private_key", uri("key.pem")},
          {authentication + "identity_crl", uri("crl.pem")},
          {"dds.sec.access.plugin", "builtin.Access-Permissions"},
          {access + "permissions_ca", uri("ca.pem")},
          {access + "governance", uri("governance.p7s")},
          {access + "permissions", uri("permissions.p7s")},
          {"dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC"}};
}

Result<Identity> open(const fs::path& folder, std::time_t now) {
  if (auto ok = check_folder(folder); !ok) return ok.error();

  const fs::path ca_file = folder / "ca.pem", cert_file = folder / "cert.pem", key_file = folder / "key.pem",
                 crl_file = folder / "crl.pem", governance_file = folder / "governance.p7s",
                 permissions_file = folder / "permissions.p7s";
  const auto authority_result = load_certificate(ca_file);
  if (!authority_result) return with_remedy(authority_result.error(), kCopyAgain);
  const auto certificate_result = load_certificate(cert_file);
  if (!certificate_result) return with_remedy(certificate_result.error(), kCopyAgain);
  const auto key_result = load_key(key_file);
  if (!key_result) return with_remedy(key_result.error(), kCopyAgain);
  const auto list_result = load_revocation_list(crl_file);
  if (!list_result) return with_remedy(list_result.error(), kCopyAgain);
  X509 &authority = **authority_result, &certificate = **certificate_result;
  X509_CRL& list = **list_result;

  if (auto ok = check_authority(ca_file, authority, now); !ok) return ok.error();
  if (auto ok = check_certificate(cert_file, certificate, authority, now); !ok) return ok.error();
  if (auto ok = check_revocations(crl_file, list, authority, now); !ok) return ok.error();
  if (auto ok = check_not_revoked(cert_file, list, certificate); !ok) return ok.error();
  const std::string subject = name_of(X509_get_subject_name(&certificate));
  if (X509_check_private_key(&certificate, key_result->get()) != 1) {
    return wrong(key_file, "another certificate's key", fmt::format("the key of cert.pem, '{}'", subject), kCopyAgain);
  }
  if (auto ok = check_as_fastdds_does(folder, certificate, authority, list, now); !ok) return ok.error();

  const auto governance_result = load_signed_text(governance_file, authority);
  if (!governance_result) return with_remedy(governance_result.error(), kCopyAgain);
  if (auto ok = check_governance(governance_file, *governance_result); !ok) return ok.error();
  const auto permissions_result = load_signed_text(permissions_file, authority);
  if (!permissions_result) return with_remedy(permissions_result.error(), kCopyAgain);
  const auto grants_result = parse_permissions(permissions_file, *permissions_result);
  if (!grants_result) return grants_result.error();
  const auto grant_result = find_grant(permissions_file, *grants_result, subject, now);
  if (!grant_result) return grant_result.error();
  const auto role_result = role_of(cert_file, certificate);
  if (!role_result) return role_result.error();

  return Identity{.name = part_of(X509_get_subject_name(&certificate), NID_commonName),
                  .subject = subject,
                  .role = *role_result,
                  .rights = grant_result->rights,
                  .not_after = std::chrono::system_clock::from_time_t(
                      std::min(period_of(certificate).not_after, grant_result->validity.not_after)),
                  .properties = properties_of(folder)};
}

}  // namespace

Result<Identity> open_identity(const fs::path& folder, SystemTime now) {
  try {
    std::error_code problem;
    fs::path whole = fs::absolute(folder, problem).lexically_normal();
    if (problem) return Error{Code::kNotFound, fmt::format("identity folder: got '{}'", folder.string())};
    if (!whole.has_filename()) whole = whole.parent_path();  // a slash at the end is no part of a name
    auto identity_result = open(whole, std::chrono::system_clock::to_time_t(now));
    ERR_clear_error();  // what was refused here is nobody's error later
    return identity_result;
  } catch (const CryptoError& error) {
    return Error{Code::kInternal, fmt::format("{}: {}", folder.string(), error.what())};
  }
}

}  // namespace jostle::wire
