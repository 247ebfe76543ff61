// Every way in which an identity folder can be wrong, and what is said about it.

#include "services/wire/security/identity.hpp"

#include <gmock/gmock.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>

#include "tests/support/forgery.hpp"

namespace jostle::wire {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using tests::Lab;

constexpr std::time_t kDay = 86'400;  // seconds

class IdentityFolder : public ::testing::Test {
 protected:
  // It is refused in words that hold all of these.
  void expect_refused(const fs::path& identity, const std::vector<std::string>& words,
                      SystemTime time = std::chrono::system_clock::now()) {
    const auto result = open_identity(identity, time);
    ASSERT_FALSE(result) << identity;
    for (const std::string& word : words) EXPECT_THAT(result.error().message, HasSubstr(word));
  }

  // Its certificate, made anew with this subject and period, key and all.
  void certify(const fs::path& identity, const Authority& authority, const Subject& subject, const Period& period) {
    const Key key = make_key();
    tests::overwrite(identity / "key.pem", to_pem(*key));
    tests::overwrite(identity / "cert.pem", to_pem(*make_certificate(authority, *key, subject, make_serial(), period)));
  }

  void permit(const fs::path& identity, const Grant& grant) {
    tests::overwrite(identity / "permissions.p7s", lab.signed_by_authority(permissions_text(grant)));
  }

  tests::TempFolder folder;
  Lab lab{folder.path() / "lab"};
  Lab other{folder.path() / "other"};
  fs::path arm = lab.issue("arm", Role::kRobot);
  fs::path helper = lab.issue("helper", Role::kWorker);
  std::string lab_name = name_of(X509_get_subject_name(lab.authority().certificate.get()));
  std::string other_name = name_of(X509_get_subject_name(other.authority().certificate.get()));
  std::time_t now = std::time(nullptr);
};

TEST_F(IdentityFolder, AsIssuedSaysWhoMayDoWhatUntilWhen) {
  const auto sut = open_identity(helper);

  ASSERT_TRUE(sut) << sut.error().message;
  EXPECT_EQ(sut->name, "helper");
  EXPECT_EQ(sut->subject, "CN=helper,OU=worker,O=Jostle");
  EXPECT_EQ(sut->role, Role::kWorker);
  EXPECT_THAT(sut->rights.publish,
              ElementsAre("rt/pool/worker", "rt/pool/result", "rt/doctor/there", "rt/doctor/back"));
  EXPECT_THAT(sut->rights.subscribe, ElementsAre("rt/pool/*", "rt/doctor/*"));
  const auto left = sut->not_after - std::chrono::system_clock::now();
  EXPECT_LE(left, 30 * 24h);
  EXPECT_GT(left, 30 * 24h - 15h);  // permissions in local time, see the header
  EXPECT_TRUE(open_identity(arm));
  EXPECT_TRUE(open_identity(lab.issue("recorder", Role::kObserver)));
  EXPECT_TRUE(open_identity(lab.issue("meeting-point", Role::kServer)));
}

TEST_F(IdentityFolder, GivesThePropertiesOfFastDdsWithAbsoluteFiles) {
  const fs::path relative = fs::relative(arm);

  const auto sut = open_identity(relative / "");

  ASSERT_TRUE(sut) << sut.error().message;
  const auto file = [&](const char* name) { return "file://" + (arm / name).string(); };
  EXPECT_THAT(sut->properties,
              ElementsAre(Pair("dds.sec.auth.plugin", "builtin.PKI-DH"),
                          Pair("dds.sec.auth.builtin.PKI-DH.identity_ca", file("ca.pem")),
                          Pair("dds.sec.auth.builtin.PKI-DH.identity_certificate", file("cert.pem")),
                          Pair("dds.sec.auth.builtin.PKI-DH.private_key", file("key.pem")),
                          Pair("dds.sec.auth.builtin.PKI-DH.identity_crl", file("crl.pem")),
                          Pair("dds.sec.access.plugin", "builtin.Access-Permissions"),
                          Pair("dds.sec.access.builtin.Access-Permissions.permissions_ca", file("ca.pem")),
                          Pair("dds.sec.access.builtin.Access-Permissions.governance", file("governance.p7s")),
                          Pair("dds.sec.access.builtin.Access-Permissions.permissions", file("permissions.p7s")),
                          Pair("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC")));
}

TEST_F(IdentityFolder, CopiedElsewhereIsGood) {
  const fs::path copy = folder.path() / "on a host";
  fs::copy(arm, copy);

  EXPECT_TRUE(open_identity(copy));
}

TEST_F(IdentityFolder, ThatIsMissingIsRefused) {
  expect_refused(folder.path() / "nowhere", {(folder.path() / "nowhere").string() + ": missing", "jostle keys issue"});
  expect_refused("", {"got ''"});
  expect_refused(arm / "cert.pem", {"got a file", "wanted an identity folder"});
}

TEST_F(IdentityFolder, ThatIsAKeystoreOrPartOfOneIsRefusedNamingItsIdentities) {
  for (const fs::path& wrong : {lab.folder(), lab.folder() / "ca", lab.folder() / "identities", lab.folder() / ""}) {
    expect_refused(wrong, {"the keystore " + lab.folder().string(), "wanted an identity's",
                           "give one of its identities: " + arm.string() + ", " + helper.string()});
  }
  expect_refused(other.folder(), {"none yet, see `jostle keys issue`"});
}

TEST_F(IdentityFolder, WithAMissingFileIsRefusedNamingTheFile) {
  for (const char* name : {"ca.pem", "cert.pem", "key.pem", "crl.pem", "governance.p7s", "permissions.p7s"}) {
    const fs::path copy = folder.path() / (std::string("without-") + name);
    fs::copy(arm, copy);
    fs::remove(copy / name);
    expect_refused(copy, {(copy / name).string() + ": missing", "copy the whole folder"});
    EXPECT_EQ(open_identity(copy).error().code, Code::kNotFound);
  }
}

TEST_F(IdentityFolder, WithAFileThatCannotBeReadIsRefusedNamingTheFile) {
  for (const char* name : {"ca.pem", "cert.pem", "key.pem", "crl.pem", "governance.p7s", "permissions.p7s"}) {
    const fs::path copy = folder.path() / (std::string("unreadable-") + name);
    fs::copy(arm, copy);
    fs::remove(copy / name);
    fs::create_directory(copy / name);  // permission bits would not stop root
    expect_refused(copy, {(copy / name).string() + ": cannot be read", "folder"});
    EXPECT_EQ(open_identity(copy).error().code, Code::kInvalidArgument);
  }
}

TEST_F(IdentityFolder, WithATruncatedOrEmptyOrForeignFileIsRefusedNamingTheFile) {
  for (const char* name : {"ca.pem", "cert.pem", "key.pem", "crl.pem", "governance.p7s", "permissions.p7s"}) {
    const std::string whole = tests::contents(arm / name);
    for (const std::string& spoilt :
         {whole.substr(0, whole.size() / 2), std::string(), std::string("fruit: apple\n")}) {
      tests::overwrite(arm / name, spoilt);
      expect_refused(arm, {(arm / name).string() + ": got " + std::to_string(spoilt.size()) + " bytes", "wanted",
                           "copy the whole folder"});
    }
    tests::overwrite(arm / name, whole);
  }
  EXPECT_TRUE(open_identity(arm));
}

TEST_F(IdentityFolder, WithAKeyUnderAPasswordIsRefusedWithoutAsking) {
  const std::unique_ptr<BIO, FreedBy<BIO_free_all>> out(BIO_new(BIO_s_mem()));
  char password[] = "secret";
  PEM_write_bio_PrivateKey(out.get(), tests::sure(load_key(arm / "key.pem")).get(), EVP_aes_128_cbc(),
                           reinterpret_cast<unsigned char*>(password), 6, nullptr, nullptr);
  char* data = nullptr;
  const long size = BIO_get_mem_data(out.get(), &data);
  tests::overwrite(arm / "key.pem", std::string(data, static_cast<std::size_t>(size)));

  expect_refused(arm, {"key.pem: got", "wanted", "private key without a password"});
}

TEST_F(IdentityFolder, ByAnotherAuthorityIsRefusedNamingBoth) {
  const fs::path stranger = other.issue("stranger", Role::kRobot);
  fs::copy_file(arm / "ca.pem", stranger / "ca.pem", fs::copy_options::overwrite_existing);

  expect_refused(stranger, {"cert.pem: got a certificate by '" + other_name + "'", "wanted one by '" + lab_name + "'",
                            "from one keystore"});
}

TEST_F(IdentityFolder, WithASignedCertificateForAnAuthorityIsRefused) {
  fs::copy_file(arm / "cert.pem", arm / "ca.pem", fs::copy_options::overwrite_existing);

  expect_refused(arm, {"ca.pem: got the certificate of 'CN=arm,OU=robot,O=Jostle'", "self-signed"});
}

TEST_F(IdentityFolder, ThatExpiredIsRefusedWithDatesAndRemedy) {
  const fs::path old = lab.issue("old", Role::kWorker, -3);

  expect_refused(old, {"cert.pem: got a certificate for ", " to " + date_text(now - 3 * kDay).substr(0, 10), "expired",
                       "wanted one for now", date_text(now).substr(0, 10), "jostle keys issue"});
}

TEST_F(IdentityFolder, ThatIsNotYetValidIsRefusedWithDatesAndTheClock) {
  certify(arm, lab.authority(), {"arm", "robot"}, {now + 5 * kDay, now + 9 * kDay});

  expect_refused(arm, {"cert.pem: got a certificate for " + date_text(now + 5 * kDay), "not yet valid", "clock"});
}

TEST_F(IdentityFolder, IsJudgedByTheTimeGiven) {
  const SystemTime start = std::chrono::system_clock::now();

  EXPECT_TRUE(open_identity(arm, start + 29 * 24h));
  expect_refused(arm, {"cert.pem", "expired", "wanted one for now"}, start + 31 * 24h);
  expect_refused(arm, {"ca.pem", "not yet valid", "clock"}, start - 3 * 24h);
  expect_refused(arm, {"ca.pem", "expired", "jostle keys init"}, start + 4000 * 24h);
}

TEST_F(IdentityFolder, ThatWasRevokedIsRefusedWithDateAndSerial) {
  const std::string serial = serial_of(*tests::sure(load_certificate(arm / "cert.pem")));
  ASSERT_TRUE(keystore::revoke(lab.folder(), "arm"));

  expect_refused(arm, {"cert.pem: got the certificate " + serial + " of 'CN=arm,OU=robot,O=Jostle'", "revoked on ",
                       "jostle keys issue"});
  EXPECT_TRUE(open_identity(helper));
}

TEST_F(IdentityFolder, WithAnExpiredRevocationListIsRefused) {
  tests::overwrite(arm / "crl.pem",
                   to_pem(*make_revocation_list(lab.authority(), {}, {now - 9 * kDay, now - 2 * kDay})));

  expect_refused(arm, {"crl.pem: got a revocation list for ", date_text(now - 2 * kDay), "expired",
                       "copy crl.pem from the keystore again"});
}

TEST_F(IdentityFolder, WithAnotherAuthoritysRevocationListIsRefused) {
  fs::copy_file(other.folder() / "ca" / "crl.pem", arm / "crl.pem", fs::copy_options::overwrite_existing);

  expect_refused(arm, {"crl.pem: got a revocation list by '" + other_name + "'", "wanted one by '" + lab_name + "'"});
}

TEST_F(IdentityFolder, WithAnotherIdentitysKeyIsRefused) {
  fs::copy_file(helper / "key.pem", arm / "key.pem", fs::copy_options::overwrite_existing);

  expect_refused(arm,
                 {"key.pem: got another certificate's key", "wanted the key of cert.pem, 'CN=arm,OU=robot,O=Jostle'"});
}

TEST_F(IdentityFolder, WithTextsOfAnotherAuthorityIsRefusedNamingBoth) {
  for (const char* name : {"governance.p7s", "permissions.p7s"}) {
    const fs::path copy = folder.path() / (std::string("foreign-") + name);
    fs::copy(arm, copy);
    fs::copy_file(other.issue(std::string("from-") + name[0], Role::kRobot) / name, copy / name,
                  fs::copy_options::overwrite_existing);
    expect_refused(copy, {std::string(name) + ": got a signature under '" + other_name + "'",
                          "wanted one by '" + lab_name + "' itself"});
  }
}

TEST_F(IdentityFolder, WithTextsChangedAfterSigningIsRefused) {
  std::string text = tests::contents(helper / "permissions.p7s");
  const std::size_t place = text.find("rt/pool/result");
  ASSERT_NE(place, std::string::npos);
  tests::overwrite(helper / "permissions.p7s", text.replace(place, 14, "rt/robot/comma"));

  expect_refused(helper,
                 {"permissions.p7s: got a text that its signature does not fit", "as '" + lab_name + "' signed it"});
}

TEST_F(IdentityFolder, WithSignedTextsThatHaveNoElementIsRefused) {
  for (const char* name : {"governance.p7s", "permissions.p7s"}) {
    for (const char* text : {"<!-- nothing -->\n", "<?xml version=\"1.0\"?>\n</max><dds></dds>\n"}) {
      const std::string before = tests::contents(arm / name);
      tests::overwrite(arm / name, lab.signed_by_authority(text));
      expect_refused(arm, {name});
      tests::overwrite(arm / name, before);
    }
  }
}

// Fast DDS takes permissions that any certificate below the CA signed, if it is
// good for S/MIME. Ours are not: neither we nor Fast DDS's own call may accept it.
TEST_F(IdentityFolder, WithPermissionsItSignedItselfIsRefused) {
  const Certificate certificate = tests::sure(load_certificate(helper / "cert.pem"));
  const std::string forged = sign_text(*certificate, *tests::sure(load_key(helper / "key.pem")),
                                       permissions_text(tests::full_grant(tests::subject_of(helper))));
  tests::overwrite(helper / "permissions.p7s", forged);

  expect_refused(helper, {"permissions.p7s: got a signature under", "itself"});

  const auto verifies = [&](const std::string& signed_text) {
    const std::unique_ptr<X509_STORE, FreedBy<X509_STORE_free>> store(X509_STORE_new());
    X509_STORE_add_cert(store.get(), lab.authority().certificate.get());
    const std::unique_ptr<BIO, FreedBy<BIO_free_all>> in(
        BIO_new_mem_buf(signed_text.data(), static_cast<int>(signed_text.size())));
    BIO* clear = nullptr;
    const std::unique_ptr<PKCS7, FreedBy<PKCS7_free>> p7(SMIME_read_PKCS7(in.get(), &clear));
    const std::unique_ptr<BIO, FreedBy<BIO_free_all>> content(clear), out(BIO_new(BIO_s_mem()));
    return PKCS7_verify(p7.get(), nullptr, store.get(), content.get(), out.get(), PKCS7_TEXT) == 1;
  };
  EXPECT_TRUE(verifies(tests::contents(arm / "permissions.p7s")));
  EXPECT_FALSE(verifies(forged));
}

TEST_F(IdentityFolder, WithAnotherIdentitysPermissionsIsRefusedWithBothSubjects) {
  fs::copy_file(arm / "permissions.p7s", helper / "permissions.p7s", fs::copy_options::overwrite_existing);

  expect_refused(helper, {"permissions.p7s: got subject_name 'CN=arm,OU=robot,O=Jostle'",
                          "RFC 2253, 'CN=helper,OU=worker,O=Jostle'", "another identity's permissions"});
}

TEST_F(IdentityFolder, WithSubjectPartsInTheWrongOrderIsRefusedSayingSo) {
  permit(arm, tests::full_grant("O=Jostle, OU=robot, CN=arm"));

  expect_refused(arm, {"permissions.p7s: got subject_name 'O=Jostle, OU=robot, CN=arm'",
                       "wanted the subject of cert.pem in the order of RFC 2253, 'CN=arm,OU=robot,O=Jostle'",
                       "their order is not"});
}

TEST_F(IdentityFolder, WithBlanksBetweenSubjectPartsIsGood) {
  permit(arm, tests::full_grant("CN=arm, OU=robot, O=Jostle"));

  EXPECT_TRUE(open_identity(arm));
}

TEST_F(IdentityFolder, WithPermissionsOutOfTheirTimeIsRefusedWithDates) {
  Grant grant = tests::full_grant(tests::subject_of(arm));
  grant.validity = {now - 9 * kDay, now - 2 * kDay};
  permit(arm, grant);
  expect_refused(arm, {"permissions.p7s: got permissions for ", "expired", "jostle keys issue"});

  grant.validity = {now + 2 * kDay, now + 9 * kDay};
  permit(arm, grant);
  expect_refused(arm, {"permissions.p7s: got permissions for ", "not yet valid", "clock"});
}

TEST_F(IdentityFolder, WithSignedTextsThatAreNoneIsRefusedNamingFileAndPlace) {
  tests::overwrite(arm / "permissions.p7s", lab.signed_by_authority("fruit: apple\n"));
  expect_refused(arm, {"permissions.p7s: got no XML"});
  tests::overwrite(arm / "permissions.p7s", lab.signed_by_authority("<dds>\n<permissions/>\n</dds>\n"));
  expect_refused(arm, {"permissions.p7s: line 1", "got no <grant>"});
  tests::overwrite(arm / "permissions.p7s", lab.signed_by_authority(governance_text()));
  expect_refused(arm, {"permissions.p7s", "got no <grant>"});
  permit(arm, tests::full_grant(tests::subject_of(arm)));
  tests::overwrite(arm / "governance.p7s", lab.signed_by_authority("<cat/>\n"));
  expect_refused(arm, {"governance.p7s: line 1", "got <cat>, wanted <dds>"});
}

TEST_F(IdentityFolder, WithoutARoleIsRefusedNamingTheRoles) {
  const std::string subject = "CN=arm,OU=chef,O=Jostle";
  certify(arm, lab.authority(), {"arm", "chef"}, {now - kDay, now + kDay});
  permit(arm, tests::full_grant(subject));

  expect_refused(arm, {"cert.pem: got role (OU) 'chef'", "wanted robot, worker, observer or server"});
}

}  // namespace
}  // namespace jostle::wire
