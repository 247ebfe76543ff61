#include "physics_pool/local/reduced_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "physics_pool/local/engine.hpp"
#include "physics_pool/local/model_xml.hpp"

namespace jostle::physics_pool {
namespace {

// Below these an object that slides comes to rest within micrometres, and one that
// leans is not falling. Settling gives less than a millimetre of height.
constexpr double kStillSpeed = 0.002;      // m/s
constexpr double kStillRotation = 0.02;    // rad/s
constexpr double kStandingHeight = 0.001;  // m
constexpr double kStandingLean = 1.5e-4;   // 1 - cos of the tilt: 1 degree

// A velocity drive is stepped explicitly: kv·h/inertia above 1 would overshoot, and
// above 2 diverge. The fine model has 0.2.
constexpr double kDriveRatio = 0.4;

// Whether the engine found its state bad and put another in its place. That a model
// of few free objects has no room for all contacts does not matter before a step:
// the next model has more.
bool has_lost_state(const mjData& data) {
  return data.warning[mjWARN_BADQPOS].number > 0 || data.warning[mjWARN_BADQVEL].number > 0;
}

double squared_norm(const double* v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

// Entries [width·from, …) of one model's array to [width·to, …) of another's.
template <class T>
void copy_entry(const T* source, int from, T* destination, int to, int width = 1) {
  std::copy_n(source + from * width, width, destination + to * width);
}

void lengthen_step(mjModel& model, double time_step) {
  model.opt.timestep = time_step;
  for (int i = 0; i < model.nu; ++i) {
    const int dof = model.jnt_dofadr[model.actuator_trnid[2 * i]];
    double& gain = model.actuator_gainprm[mjNGAIN * i];
    gain = std::min(gain, kDriveRatio * model.dof_M0[dof] / time_step);
    model.actuator_biasprm[mjNBIAS * i + 2] = -gain;
  }
}

}  // namespace

// A thread's copy of the model with `free` free objects, and who they are.
struct ReducedSimulator::Part {
  Part(const World& world, int free_count, double time_step)
      : full(*world.model()),
        objects(static_cast<int>(world.scene().objects.size())),
        free(free_count),
        model(mj_copyModel(nullptr, free == objects ? world.model() : world.reduced_model(free))),
        data(mj_makeData(model.get())),
        geoms(static_cast<int>(most_geoms(world.scene()))),
        members(static_cast<std::size_t>(objects), -1) {
    if (geoms > 1 && free < objects) {
      // What the engine's compiler took for simple, because of the bodies that it saw here, others may not be.
      std::fill(model->body_simple + first_body(), model->body_simple + model->nbody, mjtByte{0});
      std::fill_n(model->dof_simplenum, model->nv, 0);
    }
    if (time_step != world.time_step()) lengthen_step(*model, time_step);
  }

  int first_body() const { return model->nbody - objects; }
  int slot_at(int geom) const { return model->geom_bodyid[geom] - first_body(); }

  // Puts the shape and weight of `object` into slot `slot`. Numbers come from the
  // full model, where the engine's compiler has worked them out.
  void put(int slot, int object) {
    if (members[static_cast<std::size_t>(slot)] == object) return;
    members[static_cast<std::size_t>(slot)] = object;
    if (free == objects) return;  // everybody is in their own place
    mjModel& m = *model;
    const int from_body = full.nbody - objects + object, to_body = first_body() + slot;
    for (int k = 0; k < geoms; ++k) {
      const int to = m.body_geomadr[to_body] + k;
      if (k < full.body_geomnum[from_body]) {
        put_geom(to, full.body_geomadr[from_body] + k, m.body_geomadr[to_body]);
      } else {
        m.geom_contype[to] = m.geom_conaffinity[to] = 0;
      }
    }
    copy_entry(full.body_mass, from_body, m.body_mass, to_body);
    copy_entry(full.body_subtreemass, from_body, m.body_subtreemass, to_body);
    copy_entry(full.body_inertia, from_body, m.body_inertia, to_body, 3);
    copy_entry(full.body_ipos, from_body, m.body_ipos, to_body, 3);
    copy_entry(full.body_iquat, from_body, m.body_iquat, to_body, 4);
    copy_entry(full.body_sameframe, from_body, m.body_sameframe, to_body);
    if (slot >= free) return;
    copy_entry(full.body_invweight0, from_body, m.body_invweight0, to_body, 2);
    const int from_dof = full.body_dofadr[from_body], to_dof = m.body_dofadr[to_body];
    for (int i = 0; i < 6; ++i) {
      copy_entry(full.dof_invweight0, from_dof + i, m.dof_invweight0, to_dof + i);
      copy_entry(full.dof_M0, from_dof + i, m.dof_M0, to_dof + i);
    }
  }

  // `like`: a geom that touches what this one is to touch.
  void put_geom(int to, int from, int like) {
    mjModel& m = *model;
    copy_entry(full.geom_type, from, m.geom_type, to);
    copy_entry(full.geom_size, from, m.geom_size, to, 3);
    copy_entry(full.geom_rbound, from, m.geom_rbound, to);
    copy_entry(full.geom_friction, from, m.geom_friction, to, 3);
    copy_entry(full.geom_priority, from, m.geom_priority, to);
    copy_entry(full.geom_pos, from, m.geom_pos, to, 3);
    copy_entry(full.geom_quat, from, m.geom_quat, to, 4);
    copy_entry(full.geom_sameframe, from, m.geom_sameframe, to);
    copy_entry(m.geom_contype, like, m.geom_contype, to);
    copy_entry(m.geom_conaffinity, like, m.geom_conaffinity, to);
  }

  // Free objects first, both groups in the scene's order.
  void assign(const std::vector<bool>& is_free) {
    int next_free = 0, next_frozen = free;
    for (int i = 0; i < objects; ++i) put(is_free[static_cast<std::size_t>(i)] ? next_free++ : next_frozen++, i);
    mjModel& m = *model;
    m.stat.meaninertia = std::accumulate(m.dof_M0, m.dof_M0 + m.nv, 0.0) / m.nv;
  }

  void inject(const StateLayout& layout, const State& x) {
    const int joints = layout.robot_joints();
    std::copy_n(x.q.begin(), joints, data->qpos);
    std::copy_n(x.v.begin(), joints, data->qvel);
    for (int slot = 0; slot < objects; ++slot) {
      const ObjectSlot& at = slot_of(layout, slot);
      const auto q = x.q.begin() + at.q;
      if (slot < free) {
        std::copy_n(q, 7, data->qpos + joints + 7 * slot);
        std::copy_n(x.v.begin() + at.v, 6, data->qvel + joints + 6 * slot);
      } else {
        std::copy_n(q, 3, data->mocap_pos + 3 * (slot - free));
        std::copy_n(q + 3, 4, data->mocap_quat + 4 * (slot - free));
      }
    }
    forget(*model, *data);
  }

  void read(const StateLayout& layout, State& x) const {
    const int joints = layout.robot_joints();
    std::copy_n(data->qpos, joints, x.q.begin());
    std::copy_n(data->qvel, joints, x.v.begin());
    for (int slot = 0; slot < free; ++slot) {
      const ObjectSlot& at = slot_of(layout, slot);
      std::copy_n(data->qpos + joints + 7 * slot, 7, x.q.begin() + at.q);
      std::copy_n(data->qvel + joints + 6 * slot, 6, x.v.begin() + at.v);
    }
  }

  const ObjectSlot& slot_of(const StateLayout& layout, int slot) const {
    return layout.objects[static_cast<std::size_t>(members[static_cast<std::size_t>(slot)])];
  }

  const mjModel& full;
  const int objects, free;
  ModelPtr model;
  DataPtr data;
  const int geoms;           // of a slot, where some objects cannot move
  std::vector<int> members;  // object of each slot
};

ReducedSimulator::ReducedSimulator(WorldPtr world, const Fidelity& fidelity)
    : world_(std::move(world)),
      fidelity_(fidelity),
      time_step_(std::max(fidelity.time_step, world_->time_step())),
      free_(world_->scene().objects.size(), true),
      parts_(world_->scene().objects.size() + 1) {}

ReducedSimulator::~ReducedSimulator() = default;

bool stands_still(const TaskGeometry& geometry, const State& x, std::size_t object) {
  const ObjectView seen = geometry.view(x).object(object);
  const double* p = seen.position();
  const double* q = seen.orientation();
  return squared_norm(seen.linear_velocity()) < kStillSpeed * kStillSpeed &&
         squared_norm(seen.angular_velocity()) < kStillRotation * kStillRotation &&
         geometry.surface.carries(p[0], p[1]) && std::abs(p[2] - geometry.rest_heights[object]) < kStandingHeight &&
         2 * (q[1] * q[1] + q[2] * q[2]) < kStandingLean;
}

void ReducedSimulator::freeze(const State& x) {
  for (std::size_t i = 0; i < free_.size(); ++i) {
    free_[i] = !fidelity_.freeze || !stands_still(world_->geometry(), x, i);
  }
}

ReducedSimulator::Part& ReducedSimulator::enter(const State& x, std::span<const double> u) {
  const auto count = static_cast<int>(std::ranges::count(free_, true));
  std::unique_ptr<Part>& part = parts_[static_cast<std::size_t>(count)];
  if (!part) {
    part = std::make_unique<Part>(*world_, count, time_step_);
    drop_remotest(count);
  }
  part->assign(free_);
  part->inject(world_->geometry().layout, x);
  set_controls(world_->scene().robot.model, *part->data, u);
  return *part;
}

// Scratch memory grows with the square of the number: of 41 models some would have
// 25 MB each.
void ReducedSimulator::drop_remotest(int count) {
  constexpr std::ptrdiff_t kKept = 12;
  const auto exists = [](const auto& part) { return part != nullptr; };
  if (std::ranges::count_if(parts_, exists) <= kKept) return;
  const auto first = std::ranges::find_if(parts_, exists);
  const auto last = std::find_if(parts_.rbegin(), parts_.rend(), exists).base() - 1;
  const auto here = parts_.begin() + count;
  (here - first > last - here ? first : last)->reset();
}

// Looks for frozen objects among the contacts of the step that is being prepared.
// Two of them never meet, so whatever meets one can move.
int ReducedSimulator::thaw_touched(const Part& part) {
  int thawed = 0;
  for (int i = 0; i < part.data->ncon; ++i) {
    const mjContact& contact = part.data->contact[i];
    for (const int geom : {contact.geom1, contact.geom2}) {
      const int slot = part.slot_at(geom);
      if (slot < part.free) continue;
      const auto object = static_cast<std::size_t>(part.members[static_cast<std::size_t>(slot)]);
      thawed += free_[object] ? 0 : 1;
      free_[object] = true;
    }
  }
  return thawed;
}

void ReducedSimulator::run(Advance& result, State& x, std::span<const double> u, int engine_steps,
                           const std::function<bool()>& interrupted) {
  const StateLayout& layout = world_->geometry().layout;
  Part* part = &enter(x, u);
  for (int i = 0; i < engine_steps; ++i) {
    if (interrupted && interrupted()) {
      result.interrupted = true;
      return;
    }
    mj_step1(part->model.get(), part->data.get());
    while (const int thawed = thaw_touched(*part)) {
      result.thawed += static_cast<std::uint32_t>(thawed);
      if (has_lost_state(*part->data)) break;  // the check at the end says so
      part->read(layout, x);
      part = &enter(x, u);
      mj_step1(part->model.get(), part->data.get());
    }
    note_contacts(*part->model, *part->data, world_->scene(), result.facts);
    finish_step(*part->model, *part->data, world_->scene().robot.model);
    ++result.engine_steps;
  }
  result.diverged = divergence(*part->model, *part->data);
  part->read(layout, x);
}

std::size_t ReducedSimulator::bytes() const {
  std::size_t sum = 0;
  for (const auto& part : parts_) sum += part ? bytes_of(*part->data) : 0;
  return sum;
}

Advance ReducedSimulator::advance(State& x, std::span<const double> u, int engine_steps,
                                  const std::function<bool()>& interrupted, const Disturbance&) {
  Advance result;
  try {
    freeze(x);
    run(result, x, u, engine_steps, interrupted);
  } catch (const EngineError& error) {
    // The engine was left in the middle of a step: its scratch is unusable.
    for (auto& part : parts_) part.reset();
    result.diverged = error.what();
  }
  return result;
}

}  // namespace jostle::physics_pool
