#include "physics_pool/local/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <mutex>

#include "physics_pool/local/engine.hpp"
#include "physics_pool/local/model_xml.hpp"

namespace jostle::physics_pool {
namespace {

constexpr const char* kFileName = "world.xml";

Result<ModelPtr> compile_xml(const std::string& xml) {
  // The engine's compiler keeps the last parsed file in a global.
  static std::mutex compiler;
  const std::lock_guard lock(compiler);

  // mjVFS is 2 MB of names: not for the stack.
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), kFileName, static_cast<int>(xml.size()));
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), kFileName)], xml.data(), xml.size());
  char message[1000] = "";
  ModelPtr model;
  try {
    model.reset(mj_loadXML(kFileName, files.get(), message, sizeof message));
  } catch (const EngineError& error) {
    std::snprintf(message, sizeof message, "%s", error.what());
  }
  mj_deleteVFS(files.get());
  if (!model) {
    return Error{Code::kInvalidArgument, fmt::format("scene: the engine refused it: {}", message)};
  }
  return model;
}

// Whether anything is inside a fixture or an arm when the scene starts. Of what stands on the surface and of robots
// that move in the plane the scene's own check knows more.
Result<void> check_start(const World& world) {
  const Scene& scene = world.scene();
  if (scene.fixtures.empty() && as_planar(scene.robot.model)) return {};
  constexpr double kDeep = 0.0005;  // m
  const mjModel& model = *world.model();
  const DataPtr data(mj_makeData(&model));
  const State x = initial_state(scene);
  std::ranges::copy(x.q, data->qpos);
  try {
    mj_forward(&model, data.get());
  } catch (const EngineError& error) {
    return Error{Code::kInvalidArgument,
                 fmt::format("scene '{}': the engine refused its start: {}", scene.name, error.what())};
  }
  const auto name = [&](int geom) -> std::string {
    const int first_object = model.nbody - static_cast<int>(scene.objects.size());
    if (const int object = model.geom_bodyid[geom] - first_object; object >= 0)
      return fmt::format("object '{}'", scene.objects[static_cast<std::size_t>(object)].name);
    const char* known = mj_id2name(&model, mjOBJ_GEOM, geom);
    const char* body = mj_id2name(&model, mjOBJ_BODY, model.geom_bodyid[geom]);
    if (known) {
      std::string_view plain = known;
      if (plain.starts_with(kGeomPrefix)) plain.remove_prefix(std::strlen(kGeomPrefix));
      return fmt::format("'{}'", plain);
    }
    return fmt::format("robot link '{}'", body ? std::string_view(body).substr(std::strlen(kLinkPrefix)) : "?");
  };
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    const bool stands =
        model.geom_type[contact.geom1] == mjGEOM_PLANE || model.geom_type[contact.geom2] == mjGEOM_PLANE;
    if (stands || contact.dist >= -kDeep) continue;
    return Error{
        Code::kInvalidArgument,
        fmt::format("scene '{}': at its start {} is {:.1f} mm inside {}, wanted free places; move one of them, or "
                    "robot.start",
                    scene.name, name(contact.geom2), -1e3 * contact.dist, name(contact.geom1))};
  }
  return {};
}

}  // namespace

World::World(const Scene& scene, ModelPtr model)
    : scene_(scene),
      hash_(scene_hash(scene)),
      geometry_(scene),
      model_(std::move(model)),
      reduced_(scene.objects.size() + 1) {}

Result<WorldPtr> World::compile(const Scene& scene, Purpose purpose) {
  install_engine_handlers();
  auto model_result = compile_xml(model_xml(scene, {.looks = purpose == Purpose::kPictures}));
  if (!model_result) return model_result.error();
  WorldPtr world(new World(scene, std::move(model_result).value()));
  const StateLayout& layout = world->geometry().layout;
  if (world->model()->nq != layout.nq || world->model()->nv != layout.nv) {
    return Error{Code::kInternal,
                 fmt::format("scene '{}': compiled to nq {} and nv {}, its layout says {} and {}", scene.name,
                             world->model()->nq, world->model()->nv, layout.nq, layout.nv)};
  }
  if (auto ok = check_start(*world); !ok) return ok.error();
  return world;
}

std::size_t World::bytes() const { return static_cast<std::size_t>(mj_sizeModel(model_.get())); }

const mjModel* World::reduced_model(int free) const {
  const std::lock_guard lock(mutex_);
  ModelPtr& model = reduced_.at(static_cast<std::size_t>(free));
  if (!model) {
    auto model_result = compile_xml(model_xml(scene_, {.free = free}));
    if (!model_result) throw EngineError(model_result.error().message);
    model = std::move(model_result).value();
  }
  return model.get();
}

}  // namespace jostle::physics_pool
