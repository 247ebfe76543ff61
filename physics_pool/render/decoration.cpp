#include "physics_pool/render/decoration.hpp"

#include <array>

namespace jostle::physics_pool {
namespace {

using Vector = std::array<mjtNum, 3>;
using Colour = std::array<float, 4>;

constexpr Colour kPadColour{0.13f, 0.13f, 0.14f, 1.0f};
constexpr Colour kFlangeColour{0.30f, 0.31f, 0.33f, 1.0f};
constexpr Colour kJointColour{0.42f, 0.56f, 0.68f, 1.0f};

constexpr Colour kGoalColour{0.85f, 0.16f, 0.12f, 0.45f};
constexpr Colour kObstacleColour{0.10f, 0.10f, 0.11f, 0.85f};

// A shape fixed to a frame of the simulation.
struct Ornament {
  int type;      // mjtGeom
  Vector size;   // half extents; of a cylinder radius and half height
  Vector place;  // in the frame
  Colour colour;
};

void add(const mjtNum* position, const mjtNum* rotation, const Ornament& ornament, mjvScene& scene) {
  if (scene.ngeom >= scene.maxgeom) return;
  Vector place;
  mju_rotVecMat(place.data(), ornament.place.data(), rotation);
  mju_addTo3(place.data(), position);
  mjvGeom& geom = scene.geoms[scene.ngeom++];
  mjv_initGeom(&geom, ornament.type, ornament.size.data(), place.data(), rotation, ornament.colour.data());
  geom.category = mjCAT_DYNAMIC;
  geom.objtype = mjOBJ_UNKNOWN;
}

void add_pad(const mjModel& model, const mjData& data, const char* finger, mjvScene& scene) {
  const int geom = mj_name2id(&model, mjOBJ_GEOM, finger);
  // Proud of the finger by a tenth of a millimetre, so that it shows.
  const mjtNum* half = model.geom_size + 3 * geom;
  add(data.geom_xpos + 3 * geom, data.geom_xmat + 9 * geom,
      {mjGEOM_BOX, {0.4 * half[0], half[1] + 1e-4, half[2] + 1e-4}, {0.55 * half[0], 0, 0}, kPadColour}, scene);
}

void add_wrist(const mjModel& model, const mjData& data, mjvScene& scene) {
  const int palm_geom = mj_name2id(&model, mjOBJ_GEOM, "geom:palm");
  const int body = model.geom_bodyid[palm_geom];
  const mjtNum* position = data.xpos + 3 * body;
  const mjtNum* rotation = data.xmat + 9 * body;
  // Half sizes of the palm and of what is behind it.
  const mjtNum* palm = model.geom_size + 3 * palm_geom;
  const mjtNum* arm = model.geom_size + 3 * mj_name2id(&model, mjOBJ_GEOM, "geom:arm");
  const double top = palm[2], wrist = -2 * palm[0], elbow = wrist - 2 * arm[0];
  const auto cap = [&](double x, double radius, double half_height, const Colour& colour) {
    add(position, rotation, {mjGEOM_CYLINDER, {radius, half_height, 0}, {x, 0, top}, colour}, scene);
  };
  cap(wrist - 0.045, 0.040, 0.012, kFlangeColour);
  cap(wrist - 0.045, 0.032, 0.016, kJointColour);
  cap(elbow + 0.045, 0.040, 0.012, kFlangeColour);
  cap(elbow + 0.045, 0.032, 0.016, kJointColour);
}

// Flat, its top `height` metres above the surface: the higher one covers the other.
void add_disc(const Disc& disc, double height, const Colour& colour, mjvScene& scene) {
  constexpr double kThickness = 0.0002;  // m
  constexpr Vector kOrigin{0, 0, 0};
  constexpr std::array<mjtNum, 9> kUpright{1, 0, 0, 0, 1, 0, 0, 0, 1};
  add(kOrigin.data(), kUpright.data(),
      {mjGEOM_CYLINDER, {disc.radius, kThickness / 2, 0}, {disc.x, disc.y, height - kThickness / 2}, colour}, scene);
  if (scene.ngeom > 0) scene.geoms[scene.ngeom - 1].category = mjCAT_DECOR;  // no shadow
}

}  // namespace

void decorate(const SceneTask& task, const mjModel& model, const mjData& data, mjvScene& scene) {
  if (const TaskKind* kind = find_task_kind(task.kind); kind && kind->has_goal)
    add_disc(task.goal, 0.001, kGoalColour, scene);
  if (task.obstacle) add_disc(*task.obstacle, 0.002, kObstacleColour, scene);
  for (const char* part : {"geom:palm", "geom:arm", "geom:finger_left", "geom:finger_right"}) {
    if (mj_name2id(&model, mjOBJ_GEOM, part) < 0) return;
  }
  add_pad(model, data, "geom:finger_left", scene);
  add_pad(model, data, "geom:finger_right", scene);
  add_wrist(model, data, scene);
}

}  // namespace jostle::physics_pool
