#include "physics_pool/local/simulator.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "physics_pool/local/engine.hpp"
#include "physics_pool/robot/kinematics.hpp"

namespace jostle::physics_pool {

Simulator::Simulator(WorldPtr world) : world_(std::move(world)), data_(mj_makeData(world_->model())) {}

void Simulator::begin(const State& x, std::span<const double> u) {
  std::ranges::copy(x.q, data_->qpos);
  std::ranges::copy(x.v, data_->qvel);
  forget(*world_->model(), *data_);
  facts_ = {};
  set_controls(world_->scene().robot.model, *data_, u);
}

void Simulator::step() {
  const Scene& scene = world_->scene();
  // The engine's own step where there is nothing to do in its middle. RK4 has no middle: its contacts are those of its
  // last stage.
  if (scene.physics.integrator == "rk4" || (scene.fixtures.empty() && !scene.robot.model.carries_itself)) {
    mj_step(world_->model(), data_.get());
    if (!scene.fixtures.empty()) note_contacts(*world_->model(), *data_, scene, facts_);
    return;
  }
  mj_step1(world_->model(), data_.get());
  note_contacts(*world_->model(), *data_, scene, facts_);
  finish_step(*world_->model(), *data_, scene.robot.model);
}

std::string Simulator::divergence() const { return physics_pool::divergence(*world_->model(), *data_); }

void Simulator::read(State& x) const {
  const mjModel& model = *world_->model();
  x.q.assign(data_->qpos, data_->qpos + model.nq);
  x.v.assign(data_->qvel, data_->qvel + model.nv);
}

void Simulator::disturb(const VelocityNoise& noise, const NoiseStream& stream, std::uint64_t step,
                        std::span<const double> u) {
  const double sigma = noise.sigma + noise.slope * control_norm(world_->scene().robot.model, u);
  if (sigma == 0) return;
  for (int dof = 0; dof < world_->model()->nv; ++dof)
    data_->qvel[dof] += sigma * velocity_draw(noise, stream, step, dof);
}

std::size_t Simulator::bytes() const { return bytes_of(*data_); }

Advance Simulator::advance(State& x, std::span<const double> u, int engine_steps,
                           const std::function<bool()>& interrupted, const Disturbance& disturbance) {
  Advance result;
  try {
    begin(x, u);
    for (int i = 0; i < engine_steps; ++i) {
      if (interrupted && interrupted()) {
        result.interrupted = true;
        return result;
      }
      step();
      if (!disturbance.noise.is_off()) {
        disturb(disturbance.noise, disturbance.stream, disturbance.first_step + result.engine_steps, u);
      }
      ++result.engine_steps;
    }
    result.diverged = divergence();
    result.facts = facts_;
    read(x);
  } catch (const EngineError& error) {
    // The engine was left in the middle of a step: its scratch is unusable.
    data_.reset(mj_makeData(world_->model()));
    result.diverged = error.what();
  }
  return result;
}

Result<Separated> separate(const World& world, const State& x, double depth, int rounds) {
  // Without weight nothing rubs on the surface, which would hold objects of a
  // millimetre or two inside each other; and 5 ms close a gap six times faster
  // than 2 ms (acceleration · h^2 per round).
  const ModelPtr weightless(mj_copyModel(nullptr, world.model()));
  weightless->opt.gravity[2] = 0.0;
  weightless->opt.timestep = 0.005;
  const mjModel* model = weightless.get();
  const DataPtr data(mj_makeData(model));
  Separated result{.x = x};
  std::ranges::fill(result.x.v, 0.0);
  std::ranges::copy(result.x.q, data->qpos);
  try {
    for (int round = 0; round < rounds; ++round) {
      mj_forward(model, data.get());
      result.deepest = 0.0;
      for (int i = 0; i < data->ncon; ++i) result.deepest = std::max(result.deepest, -data->contact[i].dist);
      if (result.deepest <= depth) break;
      std::fill_n(data->qvel, model->nv, 0.0);
      mj_step(model, data.get());
      // The robot's place is measured better than any object's: it yields nothing.
      std::copy_n(x.q.begin(), world.geometry().layout.robot_joints(), data->qpos);
    }
  } catch (const EngineError& error) {
    return Error{Code::kInternal, fmt::format("separate: the engine diverged: {}", error.what())};
  }
  if (const std::string why = divergence(*model, *data); !why.empty()) {
    return Error{Code::kInternal, "separate: the engine diverged: " + why};
  }
  result.x.q.assign(data->qpos, data->qpos + model->nq);
  return result;
}

}  // namespace jostle::physics_pool
