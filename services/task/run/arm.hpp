#pragma once
/// \file
/// What the commands of a run move, a simulated world or an arm behind its own protocols; and who sees the objects.

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::task {

struct RunOptions;

/// What `--arm` names.
struct Arm {
  enum class Kind {
    kSim,    ///< the planner's own robot, in a simulated world
    kUrSim,  ///< a UR5 behind a simulated controller
    kUr      ///< a UR5
  };
  Kind kind = Kind::kSim;
  std::string host;  ///< of a UR5's controller
};

/// Reads "sim", "ur-sim" or "ur:HOST".
/// Error kInvalidArgument.
Result<Arm> parse_arm(const std::string& text);

/// Error kInvalidArgument: no arm moves what the scene's robot is.
Result<void> check_arm(const Arm& arm, const physics_pool::Scene& scene);

/// What `--objects` names.
struct Sensor {
  enum class Kind {
    kSim,        ///< the simulated world itself says where objects are
    kMocapSim,   ///< motion capture that is simulated, behind its own protocol
    kCameraSim,  ///< a camera that looks at rendered tags on the objects
    kMocap       ///< motion capture
  };
  Kind kind = Kind::kSim;
  std::string host;  ///< of a motion capture's server
};

/// Reads "sim", "mocap-sim", "camera-sim" or "mocap:HOST".
/// Error kInvalidArgument.
Result<Sensor> parse_sensor(const std::string& text);

/// A program that a run starts.
struct Part {
  std::string title;    ///< "the simulated world"
  std::string program;  ///< "sim"
  std::vector<std::string> arguments;
};

/// Returns what must run for the commands to move something and the objects to be seen, in the order of their start;
/// the last one is what obeys. `scene`, `belief`: files.
std::vector<Part> parts_of_world(const RunOptions& options, const std::filesystem::path& scene,
                                 const std::filesystem::path& belief, int domain);

/// Returns how long it may take until it is heard.
std::chrono::seconds patience(const Arm& arm);

/// What is to be drawn of a run.
struct Drawn {
  physics_pool::Scene scene;
  std::vector<std::vector<double>> states;  ///< [nq] of that scene
};
/// Returns the scene with the robot that moves, and turns states [nq] of the planner's scene into that scene's.
/// Error kInvalidArgument: a state that the arm cannot have.
Result<Drawn> drawn(const Arm& arm, const physics_pool::Scene& scene, const std::vector<std::vector<double>>& states);

}  // namespace jostle::task
