#include "services/wire/security/keystore.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "idl/files/files.hpp"
#include "idl/text/json.hpp"
#include "services/wire/security/documents.hpp"
#include "services/wire/security/pki.hpp"

namespace jostle::wire::keystore {
namespace {

namespace fs = std::filesystem;

constexpr std::time_t kDay = 86'400;      // seconds
constexpr std::time_t kHeadStart = kDay;  // more than clocks and time zones differ
constexpr mode_t kSecret = 0600, kPublic = 0644;

// One certificate, as index.json keeps it.
struct Record {
  std::string name;
  Role role = Role::kServer;
  std::string serial;
  std::time_t not_after = 0;
  std::time_t revoked = 0;  // 0: it was not
};

Error io_error(const fs::path& path, const char* what) {
  return {Code::kIo, fmt::format("{}: {}: {}", path.string(), what, std::strerror(errno))};
}

// Never replaces, and a secret is one from its first byte.
Result<void> write_new(const fs::path& file, const std::string& text, mode_t mode) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (descriptor < 0) return io_error(file, "cannot be written");
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = ::write(descriptor, text.data() + done, text.size() - done);
    if (count < 0 && errno != EINTR) break;
    if (count > 0) done += static_cast<std::size_t>(count);
  }
  // On the disk before anybody relies on it: an issued certificate that the
  // index forgot could not be revoked.
  const bool is_kept = done == text.size() && ::fsync(descriptor) == 0;
  const int reason = errno;
  if (::close(descriptor) == 0 && is_kept) return {};
  if (!is_kept) errno = reason;
  return io_error(file, "cannot be written");
}

Result<void> make_folder(const fs::path& folder, mode_t mode) {
  if (::mkdir(folder.c_str(), mode) == 0) return {};
  return io_error(folder, "cannot be made");
}

// Held for one call.
class Lock {
 public:
  static Result<Lock> take(const fs::path& folder) {
    const fs::path file = folder / "ca" / "index.json";
    if (::access(file.c_str(), F_OK) != 0) {
      return Error{Code::kNotFound, fmt::format("{}: got no {}, wanted a keystore; remedy: `jostle keys init {}`",
                                                folder.string(), "ca/index.json", folder.string())};
    }
    // The folder, because the index is replaced.
    const int descriptor = ::open((folder / "ca").c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor >= 0 && ::flock(descriptor, LOCK_EX) == 0) return Lock(descriptor);
    const Error error = io_error(folder / "ca", "cannot be locked");
    if (descriptor >= 0) ::close(descriptor);
    return error;
  }
  Lock(Lock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  Lock& operator=(Lock&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~Lock() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }

 private:
  explicit Lock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

std::string to_json(const std::vector<Record>& records) {
  nlohmann::json list = nlohmann::json::array();
  for (const Record& record : records) {
    list.push_back({{"name", record.name},
                    {"role", to_string(record.role)},
                    {"serial", record.serial},
                    {"not_after", record.not_after},
                    {"revoked", record.revoked}});
  }
  return nlohmann::json{{"identities", list}}.dump(2) + "\n";
}

// A moment of the index, seconds since 1970: whole, and not beyond what clocks of nanoseconds reach (the year 2255).
std::time_t moment_of(const nlohmann::json& entry, const char* key) {
  constexpr std::time_t kLatest = 9'000'000'000;
  const nlohmann::json& value = entry.at(key);
  if (!value.is_number_integer() || value.get<std::time_t>() < 0 || value.get<std::time_t>() > kLatest) {
    throw std::runtime_error(fmt::format("{}: got {}, wanted seconds, 0 to {}", key, value.dump(), kLatest));
  }
  return value.get<std::time_t>();
}

Result<std::vector<Record>> read_index(const fs::path& folder) {
  const fs::path file = folder / "ca" / "index.json";
  const auto text_result = files::read(file, files::kMostText);
  if (!text_result) return text_result.error();
  const auto index_result = parse_json(*text_result);
  if (!index_result) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got no index of a keystore: {}", file.string(), index_result.error().message)};
  }
  const nlohmann::json& index = *index_result;
  try {
    std::vector<Record> records;
    for (const auto& entry : index.at("identities")) {
      const auto role = parse_role(entry.at("role").get<std::string>());
      if (!role) throw std::runtime_error("role: got " + entry.at("role").dump());
      records.push_back({.name = entry.at("name"),
                         .role = *role,
                         .serial = entry.at("serial"),
                         .not_after = moment_of(entry, "not_after"),
                         .revoked = moment_of(entry, "revoked")});
    }
    return records;
  } catch (const std::exception& error) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got no index of a keystore: {}", file.string(), error.what())};
  }
}

Result<Authority> load_authority(const fs::path& folder) {
  auto certificate_result = load_certificate(folder / "ca" / "ca.pem");
  if (!certificate_result) return certificate_result.error();
  auto key_result = load_key(folder / "ca" / "ca.key");
  if (!key_result) return key_result.error();
  return Authority{std::move(*certificate_result), std::move(*key_result)};
}

std::time_t now_seconds() { return std::time(nullptr); }

State state_of(const Record& record, std::time_t now) {
  if (record.revoked != 0) return State::kRevoked;
  return now > record.not_after ? State::kExpired : State::kValid;
}

// As long as the authority itself: see the header.
std::string revocation_pem(const Authority& authority, const std::vector<Record>& records) {
  std::vector<Revocation> revoked;
  for (const Record& record : records) {
    if (record.revoked != 0) revoked.push_back({record.serial, record.revoked});
  }
  const Period period{.not_before = now_seconds() - kHeadStart,
                      .not_after = period_of(*authority.certificate).not_after};
  return to_pem(*make_revocation_list(authority, revoked, period));
}

bool is_name(const std::string& name) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
           c == '.';
  };
  // X.520 ends common names at 64 characters. A dot in front would hide the folder.
  return !name.empty() && name.size() <= 64 && name.front() != '.' && name.front() != '-' &&
         std::ranges::all_of(name, is_plain);
}

Result<void> check_name(const fs::path& folder, const std::vector<Record>& records, const std::string& name) {
  if (!is_name(name)) {
    return Error{Code::kInvalidArgument, fmt::format("name: got '{}', wanted 1 to 64 letters, digits, '-', '_' or '.', "
                                                     "the first a letter, digit or '_'",
                                                     name)};
  }
  for (const Record& record : records) {
    if (record.name != name || state_of(record, now_seconds()) != State::kValid) continue;
    return Error{Code::kInvalidArgument,
                 fmt::format("name: got '{}', which is valid until {}, wanted a new one; remedy: another name, or "
                             "first `jostle keys revoke {} {}`",
                             name, date_text(record.not_after), folder.string(), name)};
  }
  return {};
}

Result<void> check_validity(std::chrono::days validity, const Authority& authority) {
  const std::time_t end = period_of(*authority.certificate).not_after;
  const auto most = (end - now_seconds()) / kDay;
  if (validity.count() <= most) return {};
  return Error{Code::kInvalidArgument, fmt::format("days: got {}, wanted at most {}: the keystore itself ends on {}",
                                                   validity.count(), most, date_text(end))};
}

Result<void> write_identity(const fs::path& draft, const fs::path& folder, const Authority& authority,
                            const Record& record, const std::vector<Record>& records) {
  const Period period{.not_before = std::min(now_seconds(), record.not_after) - kHeadStart,
                      .not_after = record.not_after};
  const Key key = make_key();
  // The role is part of the subject, for which permissions are signed: those of an
  // earlier certificate of this name cannot serve it in another role.
  const auto certificate =
      make_certificate(authority, *key, {.name = record.name, .unit = to_string(record.role)}, record.serial, period);
  const std::string permissions = permissions_text({.subject = name_of(X509_get_subject_name(certificate.get())),
                                                    .validity = period,
                                                    .rights = rights_of(record.role)});
  const auto governance_result = files::read(folder / "ca" / "governance.p7s", files::kMostText);
  if (!governance_result) return governance_result.error();
  if (auto ok = make_folder(draft, 0700); !ok) return ok;
  const auto write = [&](const char* file, const std::string& text, mode_t mode) {
    return write_new(draft / file, text, mode);
  };
  if (auto ok = write("key.pem", to_pem(*key), kSecret); !ok) return ok;
  if (auto ok = write("cert.pem", to_pem(*certificate), kPublic); !ok) return ok;
  if (auto ok = write("ca.pem", to_pem(*authority.certificate), kPublic); !ok) return ok;
  if (auto ok = write("governance.p7s", *governance_result, kPublic); !ok) return ok;
  if (auto ok = write("permissions.p7s", sign_text(*authority.certificate, *authority.key, permissions), kPublic);
      !ok) {
    return ok;
  }
  return write("crl.pem", revocation_pem(authority, records), kPublic);
}

// Libcrypto's exceptions end here.
template <class T, class Work>
Result<T> guarded(const fs::path& folder, Work work) {
  try {
    return work();
  } catch (const CryptoError& error) {
    return Error{Code::kInternal, fmt::format("{}: {}", folder.string(), error.what())};
  }
}

Result<void> create_authority(const fs::path& folder) {
  const std::time_t now = now_seconds();
  // The number tells keystores apart in messages.
  const Authority authority =
      make_authority("Jostle CA " + make_serial().substr(0, 8),
                     {.not_before = now - kHeadStart, .not_after = now + kLifetime.count() * kDay});
  const fs::path ca = folder / "ca";
  if (auto ok = make_folder(ca, 0700); !ok) return ok;
  if (auto ok = write_new(ca / "ca.key", to_pem(*authority.key), kSecret); !ok) return ok;
  if (auto ok = write_new(ca / "ca.pem", to_pem(*authority.certificate), kPublic); !ok) return ok;
  const std::string governance = sign_text(*authority.certificate, *authority.key, governance_text());
  if (auto ok = write_new(ca / "governance.p7s", governance, kPublic); !ok) return ok;
  if (auto ok = write_new(ca / "crl.pem", revocation_pem(authority, {}), kPublic); !ok) return ok;
  if (auto ok = make_folder(folder / "identities", 0700); !ok) return ok;
  return write_new(ca / "index.json", to_json({}), kPublic);  // last: it makes the folder a keystore
}

}  // namespace

Result<void> create(const fs::path& folder) {
  std::error_code problem;
  if (fs::exists(folder, problem) && !(fs::is_directory(folder, problem) && fs::is_empty(folder, problem))) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got something that is there already, wanted a new or empty folder; remedy: another "
                             "name, or remove it, which makes every identity it issued a stranger's",
                             folder.string())};
  }
  if (auto ok = files::check_output({.option = "keystore", .path = folder, .endings = {}, .is_folder = true}); !ok)
    return ok;
  fs::create_directory(folder, problem);
  if (problem) return Error{Code::kIo, fmt::format("{}: cannot be made: {}", folder.string(), problem.message())};
  fs::permissions(folder, fs::perms::owner_all, problem);
  return guarded<void>(folder, [&] { return create_authority(folder); });
}

Result<fs::path> issue(const fs::path& folder, const std::string& name, Role role, std::chrono::days validity) {
  return guarded<fs::path>(folder, [&]() -> Result<fs::path> {
    const auto lock_result = Lock::take(folder);
    if (!lock_result) return lock_result.error();
    auto records_result = read_index(folder);
    if (!records_result) return records_result.error();
    std::vector<Record>& records = *records_result;
    if (auto ok = check_name(folder, records, name); !ok) return ok.error();
    const auto authority_result = load_authority(folder);
    if (!authority_result) return authority_result.error();
    if (auto ok = check_validity(validity, *authority_result); !ok) return ok.error();

    records.push_back(
        {.name = name, .role = role, .serial = make_serial(), .not_after = now_seconds() + validity.count() * kDay});
    // First of all the index: whatever is issued can be revoked.
    if (auto ok = files::write(folder / "ca" / "index.json", to_json(records)); !ok) return ok.error();
    const fs::path identity = folder / "identities" / name;
    const fs::path draft = folder / "identities" / ("." + name + ".new");
    std::error_code problem;
    fs::remove_all(draft, problem);  // of somebody who was interrupted
    auto written = write_identity(draft, folder, *authority_result, records.back(), records);
    if (written) {
      fs::remove_all(identity, problem);  // expired or revoked: check_name
      if (!problem) fs::rename(draft, identity, problem);
      if (!problem) return identity;
      written = Error{Code::kIo, fmt::format("{}: cannot be made: {}", identity.string(), problem.message())};
    }
    fs::remove_all(draft, problem);
    records.pop_back();
    (void)files::write(folder / "ca" / "index.json",
                       to_json(records));  // if not, the name is taken until it is revoked
    return written.error();
  });
}

Result<std::vector<fs::path>> revoke(const fs::path& folder, const std::string& name) {
  return guarded<std::vector<fs::path>>(folder, [&]() -> Result<std::vector<fs::path>> {
    const auto lock_result = Lock::take(folder);
    if (!lock_result) return lock_result.error();
    auto records_result = read_index(folder);
    if (!records_result) return records_result.error();
    bool is_known = false;
    for (Record& record : *records_result) {
      if (record.name != name) continue;
      is_known = true;
      if (record.revoked == 0) record.revoked = now_seconds();
    }
    if (!is_known) {
      std::vector<std::string> names;
      for (const Record& record : *records_result) names.push_back(record.name);
      std::ranges::sort(names);
      names.erase(std::unique(names.begin(), names.end()), names.end());
      return Error{Code::kNotFound,
                   fmt::format("name: got '{}', wanted one that {} issued: {}", name, folder.string(),
                               names.empty() ? "none yet" : fmt::format("{}", fmt::join(names, ", ")))};
    }
    const auto authority_result = load_authority(folder);
    if (!authority_result) return authority_result.error();
    if (auto ok = files::write(folder / "ca" / "index.json", to_json(*records_result)); !ok) return ok.error();
    const std::string pem = revocation_pem(*authority_result, *records_result);
    std::vector<fs::path> files{folder / "ca" / "crl.pem"};
    std::error_code problem;
    for (const auto& entry : fs::directory_iterator(folder / "identities", problem)) {
      if (fs::exists(entry.path() / "cert.pem", problem)) files.push_back(entry.path() / "crl.pem");
    }
    std::ranges::sort(files);
    for (const fs::path& file : files) {
      if (auto ok = files::write(file, pem); !ok) return ok.error();
    }
    return files;
  });
}

std::string to_string(State state) {
  switch (state) {
    case State::kValid:
      return "valid";
    case State::kExpired:
      return "expired";
    case State::kRevoked:
      break;
  }
  return "revoked";
}

Result<std::vector<Entry>> list(const fs::path& folder, SystemTime now) {
  const auto lock_result = Lock::take(folder);
  if (!lock_result) return lock_result.error();
  const auto records_result = read_index(folder);
  if (!records_result) return records_result.error();
  std::vector<Entry> entries;
  for (const Record& record : *records_result) {
    entries.push_back({.name = record.name,
                       .role = record.role,
                       .serial = record.serial,
                       .not_after = std::chrono::system_clock::from_time_t(record.not_after),
                       .state = state_of(record, std::chrono::system_clock::to_time_t(now))});
  }
  return entries;
}

}  // namespace jostle::wire::keystore
