// jostle tags: AprilTags on paper.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <vector>

#include "perception/tags/sheet.hpp"
#include "physics_pool/render/picture.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/world/camera/scene_tags.hpp"

namespace jostle::tools {
namespace {

using namespace perception;

struct Arguments {
  std::filesystem::path file, scene;
  std::vector<int> ids;
  double size_mm = 40.0, dpi = 600.0;
  std::string paper = "a4";
};

Result<std::vector<PrintedTag>> choose(const Arguments& arguments) {
  std::vector<PrintedTag> tags;
  const auto add = [&](int id, double size, const std::string& whose) {
    tags.push_back({.id = id, .size = size, .label = fmt::format("{}{}, {:g} mm", whose, id, 1e3 * size)});
  };
  if (arguments.scene.empty()) {
    for (const int id : arguments.ids) add(id, arguments.size_mm / 1e3, "");
    return tags;
  }
  auto scene_result = physics_pool::load_scene(arguments.scene);
  if (!scene_result) return scene_result.error();
  auto tags_result = world::tags_of(*scene_result);
  if (!tags_result) return tags_result.error();
  for (const world::ObjectTag& tag : *tags_result) add(tag.id, tag.size, tag.object + ": ");
  return tags;
}

Result<void> write_page(const Arguments& arguments, const std::vector<Page>& pages, const Paper& paper) {
  if (pages.size() > 1)
    return invalid(arguments.file.string(), fmt::format("{} pages", pages.size()), "one: a PDF has room for more");
  const double dots_per_metre = arguments.dpi / 0.0254;
  const GreyImage image = to_image(pages.front(), paper, dots_per_metre);
  physics_pool::Picture picture{.width = image.width, .height = image.height};
  picture.rgb.reserve(3 * image.pixels.size());
  for (const std::uint8_t shade : image.pixels) picture.rgb.insert(picture.rgb.end(), 3, shade);
  return physics_pool::write_png(arguments.file, picture, dots_per_metre);
}

Result<void> print(const Arguments& arguments) {
  if (auto ok = common::check_outputs({{"FILE", arguments.file, {".pdf", ".png"}}}); !ok) return ok;
  auto tags_result = choose(arguments);
  if (!tags_result) return tags_result.error();
  const Paper paper = arguments.paper == "a4" ? Paper{} : Paper{.width = 0.2159, .height = 0.2794};
  auto pages_result = lay_out(*tags_result, paper);
  if (!pages_result) return pages_result.error();
  const bool is_png = arguments.file.extension() == ".png";
  auto ok =
      is_png ? write_page(arguments, *pages_result, paper) : files::write(arguments.file, to_pdf(*pages_result, paper));
  if (ok) fmt::print("{}: {} tags on {} pages\n", arguments.file.string(), tags_result->size(), pages_result->size());
  return ok;
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  using namespace jostle;
  CLI::App app("Makes AprilTags of family 36h11 in true size.", "jostle tags");
  app.require_subcommand(1);
  tools::Arguments arguments;
  auto* print = app.add_subcommand("print", "Sheets of tags; print them without scaling");
  print->add_option("file", arguments.file, "PDF, or PNG of one page")->required();
  auto* scene = print->add_option("--scene", arguments.scene, "Tags for the objects of a scene file, as large as fit");
  auto* ids = print->add_option("--ids", arguments.ids, "Tags by their numbers, such as 0,1,7")->delimiter(',');
  auto* size = print->add_option("--size", arguments.size_mm, "Their size in mm: the outer edge of the black border")
                   ->capture_default_str()
                   ->check(CLI::Range(1.0, 200.0));
  scene->excludes(ids)->excludes(size);
  print->add_option("--paper", arguments.paper, "a4 or letter")
      ->capture_default_str()
      ->check(CLI::IsMember({"a4", "letter"}));
  print->add_option("--dpi", arguments.dpi, "Dots per inch of a PNG")
      ->capture_default_str()
      ->check(CLI::Range(72.0, 1200.0));
  app.footer("Exit codes: 0 written, 2 bad input, 3 the file could not be written.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (auto ok = tools::print(arguments); !ok) {
    fmt::print(stderr, "jostle tags: {}\n", ok.error().message);
    return common::exit_code_of(ok.error());
  }
  return common::kExitOk;
}
