#include "physics_pool/render/renderer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "idl/text/nearest.hpp"
#include "physics_pool/local/world.hpp"
#include "physics_pool/render/canvas.hpp"
#include "physics_pool/render/decoration.hpp"

namespace jostle::physics_pool {
namespace {

struct DrawList : mjvScene {
  explicit DrawList(const mjModel* model) {
    // Every geom, its shadow, lights and the decoration.
    const int capacity = 2 * model->ngeom + 100;
    mjv_defaultScene(this);
    mjv_makeScene(model, this, capacity);
  }
  ~DrawList() { mjv_freeScene(this); }
  DrawList(const DrawList&) = delete;
  DrawList& operator=(const DrawList&) = delete;
};

Result<mjvCamera> find_camera(const mjModel* model, const std::string& name) {
  const int id = mj_name2id(model, mjOBJ_CAMERA, name.c_str());
  if (id < 0) {
    std::vector<std::string> known;
    for (int i = 0; i < model->ncam; ++i) known.emplace_back(mj_id2name(model, mjOBJ_CAMERA, i));
    return Error{Code::kInvalidArgument, fmt::format("camera: got '{}', wanted one of: {}{}", name,
                                                     fmt::join(known, ", "), did_you_mean(name, known))};
  }
  mjvCamera camera;
  mjv_defaultCamera(&camera);
  camera.type = mjCAMERA_FIXED;
  camera.fixedcamid = id;
  return camera;
}

Result<void> check(const State& state, int nq) {
  if (static_cast<int>(state.q.size()) != nq) {
    return Error{Code::kInvalidArgument, fmt::format("q: got {} values, wanted {}", state.q.size(), nq)};
  }
  const auto bad = std::ranges::find_if_not(state.q, [](double value) { return std::isfinite(value); });
  if (bad == state.q.end()) return {};
  return Error{Code::kInvalidArgument,
               fmt::format("q[{}]: got {}, wanted a finite number", bad - state.q.begin(), *bad)};
}

}  // namespace

struct Renderer::Parts {
  Parts(WorldPtr w, std::unique_ptr<Canvas> c, const mjvCamera& view)
      : world(std::move(w)),
        canvas(std::move(c)),
        camera(view),
        data(mj_makeData(world->model())),
        draw_list(world->model()) {
    mjv_defaultOption(&visible);
  }

  // Shared with nobody, yet worlds come only as shared pointers.
  WorldPtr world;
  std::unique_ptr<Canvas> canvas;
  mjvCamera camera;
  mjvOption visible;
  DataPtr data;
  DrawList draw_list;
};

Renderer::Renderer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

Result<Renderer> Renderer::create(const Scene& scene, const RenderOptions& options) {
  auto world_result = World::compile(scene, World::Purpose::kPictures);
  if (!world_result) return world_result.error();
  const mjModel* model = (*world_result)->model();
  auto camera_result = find_camera(model, options.camera);
  if (!camera_result) return camera_result.error();
  auto canvas_result = Canvas::create(options.width, options.height, model);
  if (!canvas_result) return canvas_result.error();
  return Renderer(
      std::make_unique<Parts>(std::move(world_result).value(), std::move(canvas_result).value(), *camera_result));
}

Result<Picture> Renderer::render(const State& state) {
  Parts& p = *parts_;
  const mjModel* model = p.world->model();
  if (auto ok = check(state, model->nq); !ok) return ok.error();
  std::ranges::copy(state.q, p.data->qpos);
  return p.canvas->picture([&](mjrRect area, const mjrContext& context) {
    // All that drawing needs of a forward pass.
    mj_kinematics(model, p.data.get());
    mj_comPos(model, p.data.get());
    mj_camlight(model, p.data.get());
    mjv_updateScene(model, p.data.get(), &p.visible, nullptr, &p.camera, mjCAT_ALL, &p.draw_list);
    decorate(p.world->scene().task, *model, *p.data, p.draw_list);
    mjr_render(area, &p.draw_list, &context);
  });
}

Result<Picture> render(const Scene& scene, const State& state, const RenderOptions& options) {
  auto renderer_result = Renderer::create(scene, options);
  if (!renderer_result) return renderer_result.error();
  return renderer_result->render(state);
}

}  // namespace jostle::physics_pool
