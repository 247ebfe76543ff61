#include "physics_pool/local/inspection.hpp"

#include <algorithm>

#include "physics_pool/local/engine.hpp"

namespace jostle::physics_pool {

Inspector::Inspector(WorldPtr world) : world_(std::move(world)), data_(mj_makeData(world_->model())) {}

Result<Inspection> Inspector::look(const State& x, std::span<const double> u) {
  const mjModel* model = world_->model();
  const RobotModel& robot = world_->scene().robot.model;
  std::ranges::copy(x.q, data_->qpos);
  std::ranges::copy(x.v, data_->qvel);
  forget(*model, *data_);
  std::fill_n(data_->qfrc_applied, model->nv, 0.0);
  set_controls(robot, *data_, u);
  try {
    mj_forward(model, data_.get());
    mj_energyPos(model, data_.get());
    mj_energyVel(model, data_.get());
  } catch (const EngineError& error) {
    data_.reset(mj_makeData(model));
    return Error{Code::kInternal, std::string("inspect: ") + error.what()};
  }
  Inspection seen{.energy = data_->energy[0] + data_->energy[1]};
  for (int i = 0; i < data_->ncon; ++i) {
    const mjContact& contact = data_->contact[i];
    const bool is_hit = hits_fixture(*model, contact.geom1, contact.geom2);
    double& deepest = is_hit ? seen.in_fixture : seen.deepest;
    deepest = std::max(deepest, -contact.dist);
  }
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    seen.drive.push_back(data_->qfrc_actuator[j] + (robot.carries_itself ? data_->qfrc_bias[j] : 0.0));
  }
  return seen;
}

}  // namespace jostle::physics_pool
