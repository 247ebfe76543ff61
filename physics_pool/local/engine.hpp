#pragma once
/// \file
/// Guards around MuJoCo: its errors become exceptions of ours, its warnings
/// stay in mjData, and nothing is ever written to a log file.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

#include "physics_pool/local/handles.hpp"
#include "physics_pool/objective/step.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// An EngineError says what mju_error would have said before ending the process. It is thrown through
/// the engine's frames, so the mjData in use must be discarded. It never leaves
/// physics_pool/local.
class EngineError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Installs the error, warning and contact handlers; safe to call repeatedly.
void install_engine_handlers();

/// Sets the drives to u [nu], m/s and rad/s.
void set_controls(const RobotModel& robot, mjData& data, std::span<const double> u);

/// Whether one of two geoms is the robot's and the other a fixture.
bool hits_fixture(const mjModel& model, int geom_a, int geom_b);

/// Adds what the contacts of the step that is being prepared (after mj_step1) say.
void note_contacts(const mjModel& model, const mjData& data, const Scene& scene, StepFacts& facts);

/// Runs the second half of a step, mj_step2; a robot that carries itself gets the forces that balance its weight.
void finish_step(const mjModel& model, mjData& data, const RobotModel& robot);

/// Resets what earlier steps left in `data`: warm start, warnings, time.
void forget(const mjModel& model, mjData& data);

/// Says why the state is of no use: a warning since forget(), or a number
/// that is not finite. Empty if it is good.
std::string divergence(const mjModel& model, const mjData& data);

/// Returns the memory that scratch data holds.
std::size_t bytes_of(const mjData& data);

/// Marks a geom (geom_user[0]) as the surface: it supports a body only while the body's
/// centre is above it. MuJoCo's planes are infinite, yet they give steadier
/// contacts than boxes (four points under a cylinder instead of one).
inline constexpr double kSurfaceMark = 1.0;
/// Marks the floor far below, where dropped objects end; it touches nothing else.
inline constexpr double kFloorMark = 2.0;
/// These mark fixtures and the robot, so that contacts between them can be told from others.
inline constexpr double kFixtureMark = 3.0;
inline constexpr double kRobotMark = 4.0;

inline constexpr int kMaxRobotJoints = 64;

}  // namespace jostle::physics_pool
