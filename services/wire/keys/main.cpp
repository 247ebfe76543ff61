// jostle keys: makes, hands out, revokes and checks identities for protected DDS.

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "services/common/process/program.hpp"
#include "services/wire/security/identity.hpp"
#include "services/wire/security/keystore.hpp"

namespace jostle::wire {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExample =
    "Example: a robot's computer, and a workstation that simulates for it\n"
    "  jostle keys init ~/lab-keys                      makes the keystore, and identities robot and worker\n"
    "  scp -rp ~/lab-keys/identities/worker host:keys   hands one to the workstation, over a channel you trust\n"
    "  jostle keys check keys                           there: says whether it arrived, what it may do, until when\n"
    "  jostle worker --secure keys                      there: joins; here: jostle run SCENE --secure "
    "~/lab-keys/identities/robot\n"
    "Whoever has the keystore decides who may join: keep it on one machine, and a copy in a safe.";

struct Arguments {
  std::string folder, name;
  std::string role = "worker";
  int days = 365;
  bool as_json = false;
};

std::string date_text(SystemTime time) {
  return fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::chrono::system_clock::to_time_t(time)));
}

Result<void> issue_one(const Arguments& arguments, const std::string& name, const std::string& role) {
  const auto issued_result =
      keystore::issue(arguments.folder, name, *parse_role(role), std::chrono::days(arguments.days));
  if (!issued_result) return issued_result.error();
  fmt::print("{}: role {}, valid for {} days\n", issued_result->string(), role, arguments.days);
  return {};
}

Result<void> init(const Arguments& arguments) {
  if (auto ok = keystore::create(arguments.folder); !ok) return ok;
  for (const char* role : {"robot", "worker"}) {
    if (auto ok = issue_one(arguments, role, role); !ok) return ok;
  }
  fmt::print(
      "\nGive a program its folder with --secure, and copy others' folders to their hosts (scp -rp).\n"
      "{} makes identities: it stays here.\n",
      (fs::path(arguments.folder) / "ca" / "ca.key").string());
  return {};
}

Result<void> issue(const Arguments& arguments) { return issue_one(arguments, arguments.name, arguments.role); }

Result<void> revoke(const Arguments& arguments) {
  const auto files_result = keystore::revoke(arguments.folder, arguments.name);
  if (!files_result) return files_result.error();
  fmt::print("{} is revoked. Renewed:\n", arguments.name);
  for (const fs::path& file : *files_result) fmt::print("  {}\n", file.string());
  fmt::print(
      "Other hosts' copies need the new crl.pem, too. Running programs read it when they start: restart them.\n");
  return {};
}

Result<void> list(const Arguments& arguments) {
  const auto entries_result = keystore::list(arguments.folder);
  if (!entries_result) return entries_result.error();
  if (arguments.as_json) {
    nlohmann::json list = nlohmann::json::array();
    for (const keystore::Entry& entry : *entries_result) {
      list.push_back({{"name", entry.name},
                      {"role", to_string(entry.role)},
                      {"serial", entry.serial},
                      {"valid_until", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                                                  fmt::gmtime(std::chrono::system_clock::to_time_t(entry.not_after)))},
                      {"state", to_string(entry.state)}});
    }
    fmt::print("{}\n", list.dump(2));
    return {};
  }
  fmt::print("{:24} {:9} {:21} {}\n", "name", "role", "valid until", "state");
  for (const keystore::Entry& entry : *entries_result) {
    fmt::print("{:24} {:9} {:21} {}\n", entry.name, to_string(entry.role), date_text(entry.not_after),
               to_string(entry.state));
  }
  return {};
}

std::string topics_text(const std::vector<std::string>& topics) {
  if (topics.empty()) return "nothing";
  return topics.front() == "*" ? "every topic" : fmt::format("{}", fmt::join(topics, ", "));
}

Result<void> check(const Arguments& arguments) {
  const auto identity_result = open_identity(arguments.folder);
  if (!identity_result) return identity_result.error();
  const Identity& identity = *identity_result;
  fmt::print("ok {}\nrole         {}\nvalid until  {}\npublishes    {}\nsubscribes   {}\n", identity.subject,
             to_string(identity.role), date_text(identity.not_after), topics_text(identity.rights.publish),
             topics_text(identity.rights.subscribe));
  const fs::path key = fs::path(arguments.folder) / "key.pem";
  constexpr fs::perms kOthers = fs::perms::group_all | fs::perms::others_all;
  std::error_code problem;
  if ((fs::status(key, problem).permissions() & kOthers) != fs::perms::none) {
    fmt::print(stderr, "jostle keys: {}: others than its owner may open it; remedy: chmod 600 {}\n", key.string(),
               key.string());
  }
  return {};
}

using Command = Result<void> (*)(const Arguments&);

// Adds the five commands; whichever is given ends up in `chosen`.
void add_commands(CLI::App& app, Arguments& arguments, Command& chosen) {
  const auto command = [&](const char* name, const char* purpose, Command work) {
    CLI::App* added = app.add_subcommand(name, purpose);
    added->callback([&chosen, work] { chosen = work; });
    return added;
  };
  const auto add_keystore = [&](CLI::App* to) {
    to->add_option("keystore", arguments.folder, "folder of the keystore")->required();
    return to;
  };
  const auto add_name = [&](CLI::App* to) {
    to->add_option("name", arguments.name, "of the identity, and of its folder")->required();
    return to;
  };
  const auto add_days = [&](CLI::App* to) {
    to->add_option("--days", arguments.days, "how long it is valid")
        ->check(CLI::Range(1, static_cast<int>(keystore::kLifetime.count())))
        ->capture_default_str();
    return to;
  };
  add_days(add_keystore(command("init", "make a keystore, and identities named robot and worker", init)));
  add_days(add_name(add_keystore(command("issue", "make an identity", issue))))
      ->add_option("--role", arguments.role,
                   "robot: everything; worker: the pool's topics; observer: hears "
                   "everything, says nothing; server: joins, no topic")
      ->check(CLI::IsMember({"robot", "worker", "observer", "server"}))
      ->capture_default_str();
  add_name(add_keystore(command("revoke", "put an identity on the list of those who are refused", revoke)));
  add_keystore(command("list", "list what was issued: name, role, valid until, state", list))
      ->add_flag("--json", arguments.as_json, "a list of {name, role, serial, valid_until, state}");
  command("check", "say what an identity may do and until when, or what is wrong with its folder", check)
      ->add_option("folder", arguments.folder, "an identity's folder, or a copy of it")
      ->required();
}

}  // namespace
}  // namespace jostle::wire

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::wire;
  Arguments arguments;
  Command chosen = nullptr;
  CLI::App app{"Makes, hands out, revokes and checks identities, with which programs protect their DDS domain.",
               "jostle keys"};
  app.footer(std::string(kExample) + "\n" + common::exit_codes_help());
  app.require_subcommand(1);
  add_commands(app, arguments, chosen);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (auto ok = chosen(arguments); !ok) {
    fmt::print(stderr, "jostle keys: {}\n", ok.error().message);
    return common::exit_code_of(ok.error());
  }
  return common::kExitOk;
}
