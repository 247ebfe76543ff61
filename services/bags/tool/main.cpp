// jostle bag: looks into recordings, checks, saves and exports them.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <functional>
#include <string_view>

#include "services/bags/tool/commands.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace {

constexpr const char* kPlot = "plot";

constexpr const char* kExample =
    "Examples\n"
    "  jostle bag info experiment                        topics, counts, rates, what was lost\n"
    "  jostle bag verify experiment                      every checksum, every message: exit code 0 or 1\n"
    "  jostle bag recover experiment                     what is readable of a damaged one, as experiment-recovered\n"
    "  jostle bag export experiment --csv -o tables      a table per topic\n"
    "  jostle bag export experiment --json --topic '/robot/*' --from 10 --to 12 | jq .message.q\n"
    "  jostle bag plot experiment -o experiment.png      costs, distance and speeds of a run\n"
    "A bag is a folder, or one of its files (.mcap, .db3); those of rosbag2 are read, too. docs/bags.md says more.\n"
    "Exit codes: 0 done, 1 verified and damaged, something was lost, or nothing to save or export, 2 wrong arguments\n"
    "or a bag that cannot be opened, 3 output cannot be written, 130 interrupted.";

// Robots and scenes, which a plot needs, are no business of this program: another one beside it draws.
int become_plot(char** argv) {
  const std::string program = jostle::common::program_folder() / "jostle_bag_plot";
  execv(program.c_str(), argv);
  jostle::bags::tell(fmt::format("{}: cannot be started: {}", program, std::strerror(errno)));
  return jostle::common::kExitBroken;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::bags;
  if (argc > 1 && std::string_view(argv[1]) == kPlot) return become_plot(argv + 1);
  CLI::App app{"Looks into recordings, checks, saves and exports them.", "jostle bag"};
  app.footer(kExample);
  app.require_subcommand(1);
  std::function<int(std::stop_token)> work;
  std::string bag;
  const auto command = [&](const char* name, const char* purpose) {
    CLI::App* added = app.add_subcommand(name, purpose);
    added->add_option("bag", bag, "a bag's folder, or one of its files")->required();
    return added;
  };

  InfoArguments info;
  CLI::App* info_command = command("info", "topics, types, counts, rates, duration, lost samples, notes");
  info_command->add_flag("--json", info.as_json, "as an object");
  info_command->callback([&] {
    work = [&](std::stop_token) {
      info.bag = bag;
      return show_info(info);
    };
  });

  command("verify", "read everything: checksums, counts, order, definitions")->callback([&] {
    work = [&](std::stop_token stop) { return verify_bag(bag, stop); };
  });

  RecoverArguments recover;
  CLI::App* recover_command = command("recover", "save what is readable of a damaged or unfinished bag");
  recover_command->add_option("-o,--output", recover.output, "new folder (default: the bag's name and -recovered)");
  recover_command->callback([&] {
    work = [&](std::stop_token stop) {
      recover.bag = bag;
      return recover_bag(recover, stop);
    };
  });

  ExportArguments exported;
  CLI::App* export_command = command("export", "decoded messages, as tables or as JSON");
  bool as_json = false;
  CLI::Option_group* form = export_command->add_option_group("form");
  form->add_flag("--csv", exported.as_csv, "a table per topic; arrays of more than 64 elements are one cell");
  form->add_flag("--json", as_json, "an object per line");
  form->require_option(1);
  export_command
      ->add_option("--topic", exported.topics, "only topics of this pattern, such as '/robot/*'; may be given again")
      ->allow_extra_args(false);
  export_command
      ->add_option("--messages", exported.messages,
                   "folder with .msg files of types that the bag brings no definition of; may be given again")
      ->allow_extra_args(false);
  export_command->add_option("--from", exported.from, "seconds since the bag's start");
  export_command->add_option("--to", exported.to, "seconds since the bag's start");
  export_command->add_option("-o,--output", exported.output, "folder of --csv, file of --json, - for standard output")
      ->default_str("-");
  export_command->callback([&] {
    work = [&](std::stop_token stop) {
      exported.bag = bag;
      if (exported.output.empty()) exported.output = "-";
      return export_bag(exported, stop);
    };
  });

  app.add_subcommand(kPlot, "a recorded run over time, as a picture: costs of plans, distance, speeds");

  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  const common::StopSignal signal;
  return work(signal.token());
}
