// jostle experiment: the thesis's studies, run again.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/experiment/study.hpp"
#include "services/studies/experiment/study_run.hpp"
#include "services/studies/progress/work_line.hpp"

namespace jostle::studies {
namespace {

constexpr const char* kSpeaker = "jostle experiment";

// What is asked beside the study's own options.
struct Arguments {
  std::string json, plot, redraw;
  bool fresh = false;
};

int fail(const Error& error) {
  fmt::print(stderr, "{}: {}\n", kSpeaker, error.message);
  return common::exit_code_of(error);
}

std::string with_duration(const StudyAbout& about) {
  const std::string what = about.purpose.empty() ? about.title : about.purpose;
  return about.takes.empty() ? what : fmt::format("{} (about {})", what, about.takes);
}

int list(const std::vector<std::pair<std::string, std::unique_ptr<Study>>>& studies) {
  for (const auto& [name, study] : studies) fmt::print("{:<12} {}\n", name, with_duration(study->about()));
  return common::kExitOk;
}

void add_study(CLI::App& app, const std::string& name, Study& study, Arguments& arguments) {
  CLI::App* command = app.add_subcommand(name, with_duration(study.about()));
  study.add_options(*command);
  command->add_option("--json", arguments.json,
                      "File for all numbers; FILE.journal beside it keeps each finished run, and\n"
                      "the same command goes on after an interruption");
  command->add_flag("--fresh", arguments.fresh, "Start over: forget the runs that FILE.journal has");
  if (study.has_figure()) {
    command->add_option("--plot", arguments.plot, "File for the figure: .png, .svg or .pdf");
    command->add_option("--redraw", arguments.redraw, "Run nothing: draw the figure of this result file")
        ->needs("--plot");
  }
  command->footer(
      "Exit codes: 0 done, 1 parts of the system failed in some runs, 2 bad arguments,\n"
      "3 the journal is somebody else's at the moment, 130 interrupted.");
}

Result<void> draw(const Study& study, const nlohmann::json& report, const std::string& picture) {
  const auto panels = study.figure(report);
  if (!panels.empty()) return common::plot(picture, study.title(), panels);
  fmt::print(stderr, "{}: {}: not drawn: no run has come to an end that the figure shows\n", kSpeaker, picture);
  return {};
}

Result<void> redraw(const Study& study, const Arguments& arguments) {
  auto text_result = common::read_text(arguments.redraw);
  if (!text_result) return text_result.error();
  const auto wrong = [&](const std::string& what) {
    return Error{Code::kInvalidArgument, fmt::format("{}: {}", arguments.redraw, what)};
  };
  const auto report = nlohmann::json::parse(*text_result, nullptr, false);
  if (!report.is_object() || report.value("title", "") != study.title())
    return wrong(fmt::format("wanted a result of this study, with the title \"{}\"", study.title()));
  try {
    return draw(study, report, arguments.plot);
  } catch (const nlohmann::json::exception& error) {
    return wrong(error.what());
  }
}

// Null where nothing can be kept: without a result file, or where it is a pipe or the like.
Result<std::unique_ptr<common::Journal>> open_journal(const std::string& name, const Study& study,
                                                      const Arguments& arguments) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const bool is_file = !fs::exists(arguments.json, ignored) || fs::is_regular_file(arguments.json, ignored);
  if (arguments.json.empty() || arguments.json == "-" || !is_file) return std::unique_ptr<common::Journal>();
  const fs::path file = arguments.json + ".journal";
  if (arguments.fresh) fs::remove(file, ignored);
  auto origin_result = origin_of(name, study);
  if (!origin_result) return origin_result.error();
  auto journal_result = common::Journal::open(file, *origin_result);
  if (!journal_result && journal_result.error().code == Code::kInvalidArgument) {
    return Error{Code::kInvalidArgument, journal_result.error().message +
                                             "; go on as the runs were begun, or start over with --fresh, or give "
                                             "another --json"};
  }
  return journal_result;
}

Result<void> check_outputs(const Arguments& arguments) {
  if (!arguments.plot.empty()) {
    if (auto ok = common::check_picture(arguments.plot); !ok) return ok;
  }
  return common::check_outputs({{"--plot", arguments.plot, {}}, {"--json", arguments.json, {}}});
}

int run(const std::string& name, Study& study, const Arguments& arguments, std::stop_token stop) {
  if (auto ok = check_outputs(arguments); !ok) return fail(ok.error());
  if (!arguments.redraw.empty()) {
    const auto drawn = redraw(study, arguments);
    return drawn ? common::kExitOk : fail(drawn.error());
  }
  auto journal_result = open_journal(name, study, arguments);
  if (!journal_result) return fail(journal_result.error());
  common::Journal* journal = journal_result->get();
  auto line = std::make_unique<WorkLine>(fmt::format("{} {}", kSpeaker, name), "runs");
  auto end_result = run_study(study, {.stop = stop,
                                      .journal = journal,
                                      .on_begin =
                                          [&](std::size_t total, std::size_t found) {
                                            if (found > 0)
                                              line->tell(fmt::format("{} of {} runs are taken from {}", found, total,
                                                                     journal->file().string()));
                                            line->expect(total);
                                            line->skip(found);
                                          },
                                      .on_case = [&](const std::string& news) { line->step(news); },
                                      .on_trouble = [&](const std::string& trouble) { line->tell(trouble); }});
  line.reset();
  if (!end_result) return fail(end_result.error());
  StudyEnd& end = *end_result;

  if (!end.complete()) fmt::print("Partial: {} of {} runs.\n", end.done, end.total);
  fmt::print("{}", end.report.table);
  if (!arguments.json.empty()) {
    auto files_result = study_files(name);
    if (!files_result) return fail(files_result.error());
    end.report.json["files"] = *files_result;
    if (auto ok = common::write_results(arguments.json, end.report.json); !ok) return fail(ok.error());
    // What is missing is tried again; what other seeds or levels left in it may be wanted another time.
    const bool is_used_up = journal && journal->found().size() == end.found;
    if (is_used_up && end.complete() && end.broken == 0) journal->remove();
  }
  if (!arguments.plot.empty()) {
    if (auto ok = draw(study, end.report.json, arguments.plot); !ok) return fail(ok.error());
  }
  if (!end.complete()) {
    fmt::print(stderr, "{}: interrupted after {} of {} runs{}\n", kSpeaker, end.done, end.total,
               journal ? "; the same command goes on" : "");
    return common::kExitInterrupted;
  }
  return end.broken > 0 ? common::kExitFailed : common::kExitOk;
}

}  // namespace
}  // namespace jostle::studies

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::studies;
  CLI::App app(
      "Runs one of the thesis's studies and prints its table. `jostle experiment NAME --help` lists the options\n"
      "of a study.",
      kSpeaker);
  app.require_subcommand(0, 1);
  Arguments arguments;
  std::string unknown;
  auto studies = load_studies();
  for (const auto& [name, study] : studies) add_study(app, name, *study, arguments);
  const CLI::App* lists = app.add_subcommand("list", "list the studies, and how long each takes");
  app.add_option("name", unknown)->group("");  // what is no study ends up here
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;

  if (lists->parsed()) return list(studies);
  const common::StopSignal signal;
  for (const auto& [name, study] : studies) {
    if (app.get_subcommand(name)->parsed()) return run(name, *study, arguments, signal.token());
  }
  if (unknown.empty()) {
    fmt::print(stderr, "{}: wanted the name of a study, or `list`\n", kSpeaker);
    return common::kExitUsage;
  }
  return fail(load_study(unknown).error());  // there is none, or it cannot be loaded
}
