#pragma once
/// \file
/// Keys, certificates and signed texts on top of libcrypto. For the .cpp files
/// of this room, and for tests that forge what no keystore would make.

#include <openssl/evp.h>
#include <openssl/x509.h>

#include <ctime>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// Thrown if libcrypto refuses what it never refuses: no memory, no randomness.
struct CryptoError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <auto kFree>
struct FreedBy {
  template <class T>
  void operator()(T* object) const {
    kFree(object);
  }
};

using Key = std::unique_ptr<EVP_PKEY, FreedBy<EVP_PKEY_free>>;
using Certificate = std::unique_ptr<X509, FreedBy<X509_free>>;
using RevocationList = std::unique_ptr<X509_CRL, FreedBy<X509_CRL_free>>;

/// Seconds since 1970, both ends included.
struct Period {
  std::time_t not_before = 0;
  std::time_t not_after = 0;
};

/// A certificate authority: what it is known by, and what it signs with.
struct Authority {
  Certificate certificate;
  Key key;
};

/// What a certificate says of its holder: CN, OU and O of its subject.
struct Subject {
  std::string name;  ///< CN
  std::string unit;  ///< OU; empty: none
};

struct Revocation {
  std::string serial;  ///< hexadecimal, as serial_of() gives it
  std::time_t time = 0;
};

// Making. All throw CryptoError.

Key make_key();  ///< on the curve P-256
Authority make_authority(const std::string& name, const Period& period);
std::string make_serial();  ///< 126 random bits, hexadecimal
/// Holders may authenticate and nothing else: a certificate that could also sign
/// texts would let its holder write its own permissions.
Certificate make_certificate(const Authority& authority, EVP_PKEY& holder, const Subject& subject,
                             const std::string& serial, const Period& period);
RevocationList make_revocation_list(const Authority& authority, const std::vector<Revocation>& revoked,
                                    const Period& period);
/// Signs a text as S/MIME with the text in the clear (`openssl smime -sign -text`), which is how Fast DDS reads it.
std::string sign_text(X509& signer, EVP_PKEY& key, const std::string& text);

std::string to_pem(X509& certificate);
std::string to_pem(EVP_PKEY& key);
std::string to_pem(X509_CRL& list);

// Reading. Errors name the file, what was got, what was wanted.

Result<Certificate> load_certificate(const std::filesystem::path& file);
Result<Key> load_key(const std::filesystem::path& file);
Result<RevocationList> load_revocation_list(const std::filesystem::path& file);
/// Reads the text, if the authority itself signed it.
Result<std::string> load_signed_text(const std::filesystem::path& file, X509& authority);

/// Writes a certificate's holder as permissions must name it: RFC 2253, last part first.
std::string name_of(const X509_NAME* name);
/// Returns one part of a name, such as NID_commonName; empty if it has none.
std::string part_of(const X509_NAME* name, int nid);
std::string serial_of(const X509& certificate);
std::time_t time_of(const ASN1_TIME* time);
Period period_of(const X509& certificate);

/// Writes "2027-11-25 07:50 UTC".
std::string date_text(std::time_t time);

}  // namespace jostle::wire
