// jostle render: pictures and films of a scene's states, or of a recorded run.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/common/terminal/progress_line.hpp"
#include "services/tools/render/bag_frames.hpp"
#include "services/tools/render/film.hpp"
#include "services/tools/render/frames.hpp"

namespace jostle::tools {
namespace {

constexpr int kSheetFrames = 8;  // of a recorded run, unless told

struct Arguments {
  std::filesystem::path input, output;
  std::string size = "640x480", clock = "world";
  double speed = 1.0;
  BagFramesOptions bag;
  DrawOptions draw;
};

// "640x480" into two numbers; nothing else.
bool parse_size(const std::string& text, physics_pool::RenderOptions& options) {
  int end = 0;
  return std::sscanf(text.c_str(), "%4dx%4d%n", &options.width, &options.height, &end) == 2 &&
         static_cast<std::size_t>(end) == text.size();
}

bool is_scene(const std::filesystem::path& input) {
  return input.extension() == ".yaml" || input.extension() == ".yml";
}

Result<Frames> load(const Arguments& arguments) {
  if (arguments.input.extension() == ".json") return load_frames(arguments.input);
  if (is_scene(arguments.input)) return load_start(arguments.input);
  BagFramesOptions options = arguments.bag;
  options.clock = arguments.clock == "wall" ? bags::RunClock::kWall : bags::RunClock::kWorld;
  options.per_second = arguments.draw.per_second / arguments.speed;
  if (options.count == 0 && is_sheet(arguments.output)) options.count = kSheetFrames;
  return load_bag(arguments.input, options);
}

Result<void> run(const Arguments& arguments, std::stop_token stop) {
  if (auto ok = check_target(arguments.output, is_scene(arguments.input) ? "a scene's start" : ""); !ok) return ok;
  auto frames_result = load(arguments);
  if (!frames_result) return frames_result.error();
  const bool is_still = frames_result->frames.size() == 1;
  const bool is_bag = !is_scene(arguments.input) && arguments.input.extension() != ".json";
  const char* still = is_bag ? "a run in which nothing moved" : "one frame";
  if (auto ok = check_target(arguments.output, is_still ? still : ""); !ok) return ok;
  common::ProgressLine line({.doing = "drawing", .unit = "frames"});
  DrawOptions options = arguments.draw;
  options.on_progress = [&line](std::size_t drawn, std::size_t all) { line.show(drawn, all); };
  return draw(*frames_result, arguments.output, options, std::move(stop));
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::tools;
  Arguments arguments;
  CLI::App app{
      "Draws states of a scene, or a recorded run, with captions: a PNG with all side by side, a folder of\n"
      "PNGs, or a film (MP4, GIF).",
      "jostle render"};
  app.add_option(
         "input", arguments.input,
         "BAG with a recorded run; STATES.json with a scene and frames of {caption, q}; or SCENE.yaml for its start")
      ->required();
  app.add_option(
         "-o,--output", arguments.output,
         "NAME.png, NAME.mp4, NAME.gif, or a new folder for frame-00001.png, ...; - is a PNG on standard output")
      ->required();
  app.add_option("--columns", arguments.draw.columns, "of a PNG: pictures in a row")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--size", arguments.size, "WxH of each picture, pixels")->capture_default_str();
  common::suggest(app.add_option("--camera", arguments.draw.picture.camera, "overview or top")->capture_default_str(),
                  {"overview", "top"});
  app.add_option("--fps", arguments.draw.per_second, "of a film or folder: pictures per second")
      ->check(CLI::Range(0.1, 120.0))
      ->capture_default_str();
  app.add_option("--frames", arguments.bag.count,
                 "of a bag: so many, evenly spread (default: 8 for a PNG, else by --fps)")
      ->check(CLI::Range(1, 100000));
  app.add_option("--speed", arguments.speed, "of a bag: run seconds per second of film")
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  app.add_option("--clock", arguments.clock, "of a bag: world, which may stand still while a plan is made, or wall")
      ->check(CLI::IsMember({"world", "wall"}))
      ->capture_default_str();
  app.add_option("--goal", arguments.bag.goal, "goal id of the run to draw, where a bag has several");
  app.footer(common::exit_codes_help());
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (!parse_size(arguments.size, arguments.draw.picture)) {
    fmt::print(stderr, "jostle render: --size: got '{}', wanted WxH such as 640x480\n", arguments.size);
    return common::kExitUsage;
  }
  const common::StopSignal signal;
  if (auto ok = run(arguments, signal.token()); !ok) {
    fmt::print(stderr, "jostle render: {}\n", ok.error().message);
    return common::exit_code_of(ok.error());
  }
  return common::kExitOk;
}
