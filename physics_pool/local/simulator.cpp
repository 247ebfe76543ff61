#include "physics_pool/local/simulator.hpp"

#include <algorithm>

#include "physics_pool/local/engine.hpp"

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
  // The engine's own step where there is nothing to do in its middle: RK4 has none.
  if (scene.fixtures.empty() && !scene.robot.model.carries_itself) {
    mj_step(world_->model(), data_.get());
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

void Simulator::add_velocity(int dof, double amount) { data_->qvel[dof] += amount; }

Advance Simulator::advance(State& x, std::span<const double> u, int engine_steps,
                           const std::function<bool()>& interrupted) {
  Advance result;
  try {
    begin(x, u);
    for (int i = 0; i < engine_steps; ++i) {
      if (interrupted && interrupted()) {
        result.interrupted = true;
        return result;
      }
      step();
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

State separate(const World& world, const State& x, double depth, int rounds) {
  // Without weight nothing rubs on the surface, which would hold objects of a
  // millimetre or two inside each other; and 5 ms close a gap six times faster
  // than 2 ms (acceleration · h^2 per round).
  const ModelPtr weightless(mj_copyModel(nullptr, world.model()));
  weightless->opt.gravity[2] = 0.0;
  weightless->opt.timestep = 0.005;
  const mjModel* model = weightless.get();
  const DataPtr data(mj_makeData(model));
  State result = x;
  std::ranges::fill(result.v, 0.0);
  std::ranges::copy(result.q, data->qpos);
  for (int round = 0; round < rounds; ++round) {
    mj_forward(model, data.get());
    const mjContact* begin = data->contact;
    const bool apart =
        std::none_of(begin, begin + data->ncon, [&](const mjContact& contact) { return contact.dist < -depth; });
    if (apart) break;
    std::fill_n(data->qvel, model->nv, 0.0);
    mj_step(model, data.get());
    // The robot's place is measured better than any object's: it yields nothing.
    std::copy_n(x.q.begin(), world.geometry().layout.robot_joints(), data->qpos);
  }
  result.q.assign(data->qpos, data->qpos + model->nq);
  return result;
}

}  // namespace jostle::physics_pool
