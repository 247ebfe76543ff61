#include "services/wire/security/pki.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509_vfy.h>
#include <openssl/x509v3.h>

#include "idl/files/files.hpp"

namespace jostle::wire {
namespace {

using Bio = std::unique_ptr<BIO, FreedBy<BIO_free_all>>;
using Number = std::unique_ptr<BIGNUM, FreedBy<BN_free>>;
using Integer = std::unique_ptr<ASN1_INTEGER, FreedBy<ASN1_INTEGER_free>>;
using Time = std::unique_ptr<ASN1_TIME, FreedBy<ASN1_TIME_free>>;
using Signed = std::unique_ptr<PKCS7, FreedBy<PKCS7_free>>;
using Store = std::unique_ptr<X509_STORE, FreedBy<X509_STORE_free>>;

std::string last_error() {
  const unsigned long code = ERR_peek_last_error();
  const char* reason = code ? ERR_reason_error_string(code) : nullptr;
  ERR_clear_error();
  return reason ? reason : "no reason given";
}

void require(bool done, const char* what) {
  if (!done) throw CryptoError(fmt::format("libcrypto: {}: {}", what, last_error()));
}

template <class T>
T required(T object, const char* what) {
  require(object != nullptr, what);
  return object;
}

Bio memory() { return required(Bio(BIO_new(BIO_s_mem())), "buffer"); }

Bio reading(const std::string& text) {
  return required(Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))), "buffer");
}

std::string text_of(BIO& buffer) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(&buffer, &data);
  return {data, static_cast<std::size_t>(std::max(size, 0l))};
}

Integer integer_of(const std::string& serial) {
  BIGNUM* parsed = nullptr;
  require(BN_hex2bn(&parsed, serial.c_str()) > 0, "serial number");
  const Number number(parsed);
  return required(Integer(BN_to_ASN1_INTEGER(number.get(), nullptr)), "serial number");
}

Time asn1_of(std::time_t time) { return required(Time(ASN1_TIME_set(nullptr, time)), "date"); }

// Encoded from the general to the particular, so that RFC 2253, which reads from
// the end, begins with CN.
void set_name(X509_NAME& name, const Subject& subject) {
  const auto add = [&](const char* field, const std::string& value) {
    if (value.empty()) return;
    require(X509_NAME_add_entry_by_txt(&name, field, MBSTRING_UTF8,
                                       reinterpret_cast<const unsigned char*>(value.c_str()), -1, -1, 0),
            "subject");
  };
  add("O", "Jostle");
  add("OU", subject.unit);
  add("CN", subject.name);
}

void extend(X509& certificate, X509& issuer, int nid, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, &issuer, &certificate, nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, FreedBy<X509_EXTENSION_free>> extension(
      X509V3_EXT_conf_nid(nullptr, &context, nid, value));
  require(extension && X509_add_ext(&certificate, extension.get(), -1), "certificate extension");
}

Certificate unsigned_certificate(EVP_PKEY& holder, const Subject& subject, const std::string& serial,
                                 const Period& period) {
  Certificate certificate = required(Certificate(X509_new()), "certificate");
  require(X509_set_version(certificate.get(), X509_VERSION_3), "certificate version");
  require(X509_set_serialNumber(certificate.get(), integer_of(serial).get()), "serial number");
  require(X509_set1_notBefore(certificate.get(), asn1_of(period.not_before).get()), "date");
  require(X509_set1_notAfter(certificate.get(), asn1_of(period.not_after).get()), "date");
  require(X509_set_pubkey(certificate.get(), &holder), "public key");
  set_name(*X509_get_subject_name(certificate.get()), subject);
  return certificate;
}

void sign(X509& certificate, EVP_PKEY& key) { require(X509_sign(&certificate, &key, EVP_sha256()) > 0, "signature"); }

// What a PEM file may hold, and how libcrypto reads it.
template <class Handle, class Read>
Result<Handle> load_pem(const std::filesystem::path& file, const char* wanted, Read read) {
  const auto text_result = files::read(file, files::kMostText);
  if (!text_result) return text_result.error();
  Handle object(read(reading(*text_result).get()));
  if (object) return object;
  const std::string reason = last_error();
  return Error{Code::kInvalidArgument, fmt::format("{}: got {} bytes that are no {} ({}), wanted a PEM file",
                                                   file.string(), text_result->size(), wanted, reason)};
}

// Libcrypto would ask at the terminal.
int no_password(char*, int, int, void*) { return -1; }

// Names whoever signed a text, as far as that can be told.
std::string signer_of(PKCS7& signed_text) {
  STACK_OF(PKCS7_SIGNER_INFO)* signers = PKCS7_get_signer_info(&signed_text);
  if (!signers || sk_PKCS7_SIGNER_INFO_num(signers) == 0) return "nobody";
  return name_of(sk_PKCS7_SIGNER_INFO_value(signers, 0)->issuer_and_serial->issuer);
}

bool is_signed_by(PKCS7& signed_text, const X509& authority) {
  STACK_OF(PKCS7_SIGNER_INFO)* signers = PKCS7_get_signer_info(&signed_text);
  if (!signers || sk_PKCS7_SIGNER_INFO_num(signers) != 1) return false;
  const auto* issuer_and_serial = sk_PKCS7_SIGNER_INFO_value(signers, 0)->issuer_and_serial;
  return X509_NAME_cmp(issuer_and_serial->issuer, X509_get_issuer_name(&authority)) == 0 &&
         ASN1_INTEGER_cmp(issuer_and_serial->serial, X509_get0_serialNumber(&authority)) == 0;
}

}  // namespace

Key make_key() { return required(Key(EVP_EC_gen("P-256")), "key"); }

std::string make_serial() {
  const Number number = required(Number(BN_new()), "serial number");
  // The top bit set: equal lengths, and never zero or negative.
  require(BN_rand(number.get(), 127, BN_RAND_TOP_ONE, BN_RAND_BOTTOM_ANY), "random number");
  const std::unique_ptr<char, void (*)(char*)> text(BN_bn2hex(number.get()), [](char* it) { OPENSSL_free(it); });
  return required(text.get(), "serial number");
}

Authority make_authority(const std::string& name, const Period& period) {
  Authority authority{.certificate = nullptr, .key = make_key()};
  authority.certificate = unsigned_certificate(*authority.key, {.name = name}, make_serial(), period);
  X509& certificate = *authority.certificate;
  require(X509_set_issuer_name(&certificate, X509_get_subject_name(&certificate)), "issuer");
  extend(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  // digitalSignature is for governance and permissions.
  extend(certificate, certificate, NID_key_usage, "critical,digitalSignature,keyCertSign,cRLSign");
  extend(certificate, certificate, NID_subject_key_identifier, "hash");
  sign(certificate, *authority.key);
  return authority;
}

Certificate make_certificate(const Authority& authority, EVP_PKEY& holder, const Subject& subject,
                             const std::string& serial, const Period& period) {
  Certificate certificate = unsigned_certificate(holder, subject, serial, period);
  X509& issuer = *authority.certificate;
  require(X509_set_issuer_name(certificate.get(), X509_get_subject_name(&issuer)), "issuer");
  extend(*certificate, issuer, NID_basic_constraints, "critical,CA:FALSE");
  extend(*certificate, issuer, NID_key_usage, "critical,digitalSignature");
  // Without this list a certificate is good for S/MIME, too. Fast DDS takes
  // permissions from any S/MIME signer below the CA.
  extend(*certificate, issuer, NID_ext_key_usage, "critical,clientAuth,serverAuth");
  extend(*certificate, issuer, NID_subject_key_identifier, "hash");
  extend(*certificate, issuer, NID_authority_key_identifier, "keyid:always");
  sign(*certificate, *authority.key);
  return certificate;
}

RevocationList make_revocation_list(const Authority& authority, const std::vector<Revocation>& revoked,
                                    const Period& period) {
  RevocationList list = required(RevocationList(X509_CRL_new()), "revocation list");
  require(X509_CRL_set_version(list.get(), X509_CRL_VERSION_2), "revocation list");
  require(X509_CRL_set_issuer_name(list.get(), X509_get_subject_name(authority.certificate.get())), "issuer");
  require(X509_CRL_set1_lastUpdate(list.get(), asn1_of(period.not_before).get()), "date");
  require(X509_CRL_set1_nextUpdate(list.get(), asn1_of(period.not_after).get()), "date");
  for (const Revocation& revocation : revoked) {
    std::unique_ptr<X509_REVOKED, FreedBy<X509_REVOKED_free>> entry(X509_REVOKED_new());
    require(entry && X509_REVOKED_set_serialNumber(entry.get(), integer_of(revocation.serial).get()) &&
                X509_REVOKED_set_revocationDate(entry.get(), asn1_of(revocation.time).get()) &&
                X509_CRL_add0_revoked(list.get(), entry.get()),
            "revoked certificate");
    entry.release();  // the list's now
  }
  require(X509_CRL_sort(list.get()) && X509_CRL_sign(list.get(), authority.key.get(), EVP_sha256()) > 0,
          "revocation list");
  return list;
}

std::string sign_text(X509& signer, EVP_PKEY& key, const std::string& text) {
  constexpr int kFlags = PKCS7_TEXT | PKCS7_DETACHED;
  const Bio content = reading(text);
  const Signed signed_text = required(Signed(PKCS7_sign(&signer, &key, nullptr, content.get(), kFlags)), "signature");
  const Bio again = reading(text), out = memory();
  require(SMIME_write_PKCS7(out.get(), signed_text.get(), again.get(), kFlags), "signed text");
  return text_of(*out);
}

std::string to_pem(X509& certificate) {
  const Bio out = memory();
  require(PEM_write_bio_X509(out.get(), &certificate), "PEM");
  return text_of(*out);
}

std::string to_pem(EVP_PKEY& key) {
  const Bio out = memory();
  require(PEM_write_bio_PrivateKey(out.get(), &key, nullptr, nullptr, 0, nullptr, nullptr), "PEM");
  return text_of(*out);
}

std::string to_pem(X509_CRL& list) {
  const Bio out = memory();
  require(PEM_write_bio_X509_CRL(out.get(), &list), "PEM");
  return text_of(*out);
}

Result<Certificate> load_certificate(const std::filesystem::path& file) {
  return load_pem<Certificate>(file, "certificate",
                               [](BIO* in) { return PEM_read_bio_X509(in, nullptr, no_password, nullptr); });
}

Result<Key> load_key(const std::filesystem::path& file) {
  return load_pem<Key>(file, "private key without a password",
                       [](BIO* in) { return PEM_read_bio_PrivateKey(in, nullptr, no_password, nullptr); });
}

Result<RevocationList> load_revocation_list(const std::filesystem::path& file) {
  return load_pem<RevocationList>(file, "revocation list",
                                  [](BIO* in) { return PEM_read_bio_X509_CRL(in, nullptr, no_password, nullptr); });
}

Result<std::string> load_signed_text(const std::filesystem::path& file, X509& authority) {
  const auto file_result = files::read(file, files::kMostText);
  if (!file_result) return file_result.error();
  const Bio in = reading(*file_result);
  BIO* clear = nullptr;
  const Signed signed_text(SMIME_read_PKCS7(in.get(), &clear));
  const Bio content(clear);
  if (!signed_text || !PKCS7_type_is_signed(signed_text.get())) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got {} bytes that are no signed text ({}), wanted an S/MIME file", file.string(),
                             file_result->size(), last_error())};
  }
  const std::string wanted = name_of(X509_get_subject_name(&authority));
  if (!is_signed_by(*signed_text, authority)) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got a signature under '{}', wanted one by '{}' itself",
                                                     file.string(), signer_of(*signed_text), wanted)};
  }
  // The call that Fast DDS makes. Dates are not its business: whoever loads a
  // text has looked at the authority's.
  const Store store = required(Store(X509_STORE_new()), "store");
  require(X509_STORE_add_cert(store.get(), &authority), "store");
  X509_VERIFY_PARAM_set_flags(X509_STORE_get0_param(store.get()), X509_V_FLAG_NO_CHECK_TIME);
  const Bio out = memory();
  if (!PKCS7_verify(signed_text.get(), nullptr, store.get(), content.get(), out.get(), PKCS7_TEXT)) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got a text that its signature does not fit ({}), wanted it as '{}' signed it",
                             file.string(), last_error(), wanted)};
  }
  return text_of(*out);
}

std::string name_of(const X509_NAME* name) {
  const Bio out = memory();
  // The flags with which Fast DDS compares.
  X509_NAME_print_ex(out.get(), name, 0, XN_FLAG_RFC2253 & ~ASN1_STRFLGS_ESC_MSB);
  return text_of(*out);
}

std::string part_of(const X509_NAME* name, int nid) {
  const int index = X509_NAME_get_index_by_NID(name, nid, -1);
  if (index < 0) return "";
  unsigned char* utf8 = nullptr;
  const int size = ASN1_STRING_to_UTF8(&utf8, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, index)));
  if (size < 0) return "";
  std::string text(reinterpret_cast<char*>(utf8), static_cast<std::size_t>(size));
  OPENSSL_free(utf8);
  return text;
}

std::string serial_of(const X509& certificate) {
  const Number number =
      required(Number(ASN1_INTEGER_to_BN(X509_get0_serialNumber(&certificate), nullptr)), "serial number");
  const std::unique_ptr<char, void (*)(char*)> text(BN_bn2hex(number.get()), [](char* it) { OPENSSL_free(it); });
  return required(text.get(), "serial number");
}

std::time_t time_of(const ASN1_TIME* time) {
  std::tm parts{};
  return time && ASN1_TIME_to_tm(time, &parts) ? timegm(&parts) : 0;
}

Period period_of(const X509& certificate) {
  return {.not_before = time_of(X509_get0_notBefore(&certificate)),
          .not_after = time_of(X509_get0_notAfter(&certificate))};
}

std::string date_text(std::time_t time) { return fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(time)); }

}  // namespace jostle::wire
