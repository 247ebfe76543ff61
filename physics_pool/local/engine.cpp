#include "physics_pool/local/engine.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "idl/types/state.hpp"

namespace jostle::physics_pool {
namespace {

void throw_error(const char* message) { throw EngineError(message); }

// Warnings are counted in mjData::warning, which every rollout reads.
void ignore_warning(const char*) {}

double mark(const mjModel* model, int geom) {
  return model->nuser_geom > 0 ? model->geom_user[geom * model->nuser_geom] : 0.0;
}

// Whether a marked plane cannot meet a geom where its body is.
bool is_out_of_reach(const mjModel* model, const mjData* data, int plane, int geom) {
  constexpr double kDropped = -0.2;  // m; nothing on the surface has its centre so low
  const mjtNum* centre = data->xpos + 3 * model->geom_bodyid[geom];
  if (mark(model, plane) == kFloorMark) return centre[2] > kDropped;
  const mjtNum* half = model->geom_size + 3 * plane;
  const mjtNum* middle = model->geom_pos + 3 * plane;
  return std::abs(centre[0] - middle[0]) > half[0] || std::abs(centre[1] - middle[1]) > half[1];
}

bool is_plane(const mjModel* model, int geom) {
  const double value = mark(model, geom);
  return value == kSurfaceMark || value == kFloorMark;
}

// Returns nonzero to discard a pair. Replaces the engine's own mask test.
int filter_contact(const mjModel* model, mjData* data, int a, int b) {
  const bool paired = (model->geom_contype[a] & model->geom_conaffinity[b]) != 0 ||
                      (model->geom_contype[b] & model->geom_conaffinity[a]) != 0;
  if (!paired) return 1;
  if (is_plane(model, a)) return is_out_of_reach(model, data, a, b) ? 1 : 0;
  if (is_plane(model, b)) return is_out_of_reach(model, data, b, a) ? 1 : 0;
  return 0;
}

}  // namespace

void install_engine_handlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    mju_user_error = throw_error;
    mju_user_warning = ignore_warning;
    mjcb_contactfilter = filter_contact;
  });
}

void set_controls(const RobotModel& robot, mjData& data, std::span<const double> u) {
  // Actuators are those joints that are driven, in their order.
  int actuator_of[kMaxRobotJoints], actuators = 0;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    if (robot.joints[j].gain > 0) data.ctrl[actuator_of[j] = actuators++] = 0.0;
  }
  for (std::size_t i = 0; i < u.size(); ++i) {
    for (const auto& [joint, factor] : robot.axes[i].joints) data.ctrl[actuator_of[joint]] += factor * u[i];
  }
}

bool hits_fixture(const mjModel& model, int geom_a, int geom_b) {
  const double a = mark(&model, geom_a), b = mark(&model, geom_b);
  return (a == kFixtureMark && b == kRobotMark) || (a == kRobotMark && b == kFixtureMark);
}

void note_contacts(const mjModel& model, const mjData& data, const Scene& scene, StepFacts& facts) {
  if (scene.fixtures.empty() || facts.robot_hit_fixture) return;
  for (int i = 0; i < data.ncon; ++i) {
    if (hits_fixture(model, data.contact[i].geom1, data.contact[i].geom2)) facts.robot_hit_fixture = true;
  }
}

void finish_step(const mjModel& model, mjData& data, const RobotModel& robot) {
  if (robot.carries_itself) std::copy_n(data.qfrc_bias, robot.joints.size(), data.qfrc_applied);
  mj_step2(&model, &data);
}

void forget(const mjModel& model, mjData& data) {
  std::fill_n(data.qacc_warmstart, model.nv, 0.0);
  for (mjWarningStat& warning : data.warning) warning.number = 0;
  data.time = 0.0;
}

std::string divergence(const mjModel& model, const mjData& data) {
  for (int i = 0; i < mjNWARNING; ++i) {
    if (data.warning[i].number > 0) {
      return mju_warningText(i, static_cast<std::size_t>(data.warning[i].lastinfo));
    }
  }
  const auto is_finite = [](double value) { return std::isfinite(value); };
  const bool finite = std::all_of(data.qpos, data.qpos + model.nq, is_finite) &&
                      std::all_of(data.qvel, data.qvel + model.nv, is_finite);
  return finite ? "" : "non-finite state";
}

void ModelDeleter::operator()(mjModel* model) const { mj_deleteModel(model); }
void DataDeleter::operator()(mjData* data) const { mj_deleteData(data); }

const char* engine_version() { return mj_versionString(); }

std::size_t bytes_of(const mjData& data) {
  return sizeof(mjData) + static_cast<std::size_t>(data.nbuffer) +
         sizeof(mjtNum) * static_cast<std::size_t>(data.nstack);
}

}  // namespace jostle::physics_pool
