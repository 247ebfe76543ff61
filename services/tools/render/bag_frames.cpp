#include "services/tools/render/bag_frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/bags/format/bag_reader.hpp"

namespace jostle::tools {
namespace {

Result<bags::RecordedRun> only_run(bags::BagReader& reader, const std::string& goal) {
  auto runs_result = bags::read_runs(reader);
  if (!runs_result) return runs_result.error();
  runs_result = bags::select_runs(std::move(runs_result).value(), goal);
  if (!runs_result) return runs_result.error();
  if (runs_result->size() == 1) return std::move(runs_result->front());
  std::string ids;
  for (const bags::RecordedRun& run : *runs_result) ids += (ids.empty() ? "" : ", ") + run.run.goal().goal_id();
  return Error{Code::kInvalidArgument, fmt::format("{}: got {} runs, wanted --goal with one of {}",
                                                   reader.info().path.string(), runs_result->size(), ids)};
}

std::string caption_of(const bags::RecordedMotion::Sample& sample, const bags::RecordedRun& run, bool last) {
  std::string text = fmt::format("t = {:.1f} s", sample.time);
  if (sample.plan >= 0) text += fmt::format("   plan {}", sample.plan);
  if (sample.action > 0) text += fmt::format("   action {}", sample.action);
  if (last && run.result) text += fmt::format("   ({})", run.result->reason());
  return text;
}

}  // namespace

Result<Frames> load_bag(const std::filesystem::path& bag, const BagFramesOptions& options) {
  auto reader_result = bags::BagReader::open(bag);
  if (!reader_result) return reader_result.error();
  auto run_result = only_run(**reader_result, options.goal);
  if (!run_result) return run_result.error();
  const bags::RecordedRun& run = *run_result;
  auto scene_result = physics_pool::parse_scene(run.run.goal().execution_scene(), bag.string() + ": scene");
  if (!scene_result) return scene_result.error();
  auto motion_result = bags::RecordedMotion::read(**reader_result, run, layout_of(*scene_result), options.clock);
  if (!motion_result) return motion_result.error();

  Frames frames{.scene = std::move(scene_result).value()};
  const double duration = motion_result->duration();
  const int count = options.count > 0 ? options.count : static_cast<int>(std::ceil(duration * options.per_second)) + 1;
  for (int i = 0; i < count; ++i) {
    const double share = count == 1 ? 0.0 : static_cast<double>(i) / (count - 1);
    auto sample = motion_result->at(options.count > 0 ? share * duration : std::min(i / options.per_second, duration));
    frames.frames.push_back({.caption = caption_of(sample, run, i + 1 == count), .state = std::move(sample.state)});
  }
  return frames;
}

}  // namespace jostle::tools
