// jostle render: pictures of a scene's states.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "physics_pool/render/montage.hpp"
#include "physics_pool/render/renderer.hpp"
#include "services/render_cli/frames.hpp"
#include "services/support/program.hpp"

namespace jostle::services {
namespace {


struct Arguments {
  std::filesystem::path input, output;
  int columns = 4;
  std::string size = "640x480";
  physics_pool::RenderOptions options;
};

// "640x480" into two numbers; nothing else.
bool parse_size(const std::string& text, physics_pool::RenderOptions& options) {
  int end = 0;
  return std::sscanf(text.c_str(), "%4dx%4d%n", &options.width, &options.height, &end) == 2 &&
         static_cast<std::size_t>(end) == text.size();
}

Result<std::vector<physics_pool::Picture>> draw(const Frames& input,
                                                const physics_pool::RenderOptions& options) {
  auto renderer_result = physics_pool::Renderer::create(input.scene, options);
  if (!renderer_result) return renderer_result.error();
  std::vector<physics_pool::Picture> pictures;
  for (std::size_t i = 0; i < input.frames.size(); ++i) {
    auto picture_result = renderer_result->render(input.frames[i].state);
    if (!picture_result) {
      return Error{picture_result.error().code, fmt::format("frames[{}].{}", i, picture_result.error().message)};
    }
    pictures.push_back(std::move(picture_result).value());
  }
  return pictures;
}

Result<void> run(const Arguments& arguments) {
  auto input_result = arguments.input.extension() == ".json" ? load_frames(arguments.input)
                                                             : load_start(arguments.input);
  if (!input_result) return input_result.error();
  auto pictures_result = draw(*input_result, arguments.options);
  if (!pictures_result) return pictures_result.error();
  std::vector<std::string> captions;
  for (const Frame& frame : input_result->frames) captions.push_back(frame.caption);
  auto sheet_result = physics_pool::montage(*pictures_result, captions, arguments.columns);
  if (!sheet_result) return sheet_result.error();
  return physics_pool::write_png(arguments.output, *sheet_result);
}

}  // namespace
}  // namespace jostle::services

int main(int argc, char** argv) {
  using namespace jostle::services;
  Arguments arguments;
  CLI::App app{"Draws states of a scene, side by side with captions, as a PNG.", "jostle render"};
  app.add_option("input", arguments.input,
                 "STATES.json with a scene and frames of {caption, q}, or SCENE.yaml for its start")->required();
  app.add_option("-o,--output", arguments.output, "the PNG to write")->required();
  app.add_option("--columns", arguments.columns, "pictures in a row")
      ->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--size", arguments.size, "WxH of each picture, pixels")->capture_default_str();
  app.add_option("--camera", arguments.options.camera, "overview or top")->capture_default_str();
  if (const auto code = parse_arguments(app, argc, argv)) return *code;
  if (!parse_size(arguments.size, arguments.options)) {
    fmt::print(stderr, "jostle render: --size: got '{}', wanted WxH such as 640x480\n", arguments.size);
    return kExitUsage;
  }
  if (auto ok = run(arguments); !ok) {
    fmt::print(stderr, "jostle render: {}\n", ok.error().message);
    return kExitFailed;
  }
  return 0;
}
