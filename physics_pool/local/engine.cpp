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
  return std::abs(centre[0]) > half[0] || std::abs(centre[1]) > half[1];
}

// Returns nonzero to discard a pair. Replaces the engine's own mask test.
int filter_contact(const mjModel* model, mjData* data, int a, int b) {
  const bool paired = (model->geom_contype[a] & model->geom_conaffinity[b]) != 0 ||
                      (model->geom_contype[b] & model->geom_conaffinity[a]) != 0;
  if (!paired) return 1;
  if (mark(model, a) != 0.0) return is_out_of_reach(model, data, a, b) ? 1 : 0;
  if (mark(model, b) != 0.0) return is_out_of_reach(model, data, b, a) ? 1 : 0;
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

void set_controls(mjData& data, std::span<const double> u) {
  data.ctrl[0] = u[kControlX];
  data.ctrl[1] = u[kControlY];
  if (u.size() == kPusherAxes) return;
  data.ctrl[2] = u[kControlRotation];
  data.ctrl[3] = data.ctrl[4] = u[kControlOpening] / 2;
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

}  // namespace jostle::physics_pool
