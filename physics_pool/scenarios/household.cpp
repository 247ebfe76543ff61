#include "physics_pool/scenarios/household.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace jostle::physics_pool {
namespace {

struct Thing {
  const char* name;
  double mass;                // kg
  double radius, height;      // m, of what is round
  std::array<double, 3> box;  // m, of what is not
};

// In the order of Household.
constexpr std::array<Thing, kHouseholds> kThings{
    Thing{"soup_can", 0.349, 0.033, 0.101, {}},                  // 005 tomato soup can
    Thing{"coffee_can", 0.414, 0.051, 0.139, {}},                // 002 master chef can
    Thing{"chips_can", 0.205, 0.0375, 0.25, {}},                 // 001 chips can
    Thing{"mug", 0.118, 0.04, 0.082, {}},                        // 025
    Thing{"bowl", 0.147, 0.0795, 0.053, {}},                     // 024
    Thing{"cracker_box", 0.411, 0, 0, {0.06, 0.158, 0.21}},      // 003
    Thing{"sugar_box", 0.514, 0, 0, {0.038, 0.089, 0.175}},      // 004
    Thing{"mustard_bottle", 0.603, 0, 0, {0.058, 0.095, 0.19}},  // 006, its box
    Thing{"pudding_box", 0.187, 0, 0, {0.035, 0.11, 0.089}},     // 008
    Thing{"gelatin_box", 0.097, 0, 0, {0.028, 0.085, 0.073}},    // 009
    Thing{"meat_can", 0.37, 0, 0, {0.05, 0.097, 0.082}},         // 010 potted meat can
};

// As wide as four fingers are, as high as two thirds of the mug.
ObjectPart handle(const Thing& mug) {
  constexpr double kOut = 0.025, kWidth = 0.012;  // m
  constexpr double kIn = 0.002;                   // m, so that there is no gap
  return {.size = {kOut, kWidth, 2 * mug.height / 3}, .pose = {.position = {mug.radius + kOut / 2 - kIn, 0, 0}}};
}

// A regular polygon whose corners are on the bowl's rim.
std::vector<ObjectPart> wall(const Thing& bowl, double bottom) {
  constexpr int kSides = 8;
  constexpr double kThickness = 0.005;  // m
  std::vector<ObjectPart> sides;
  const double half_turn = std::numbers::pi / kSides;
  const double from_middle = bowl.radius * std::cos(half_turn) - kThickness / 2;
  for (int i = 0; i < kSides; ++i) {
    const double yaw = 2 * half_turn * i;
    sides.push_back({.size = {kThickness, 2 * bowl.radius * std::sin(half_turn), bowl.height - bottom},
                     .pose = {.position = {from_middle * std::cos(yaw), from_middle * std::sin(yaw), bowl.height / 2},
                              .orientation = turned_about_z(yaw)}});
  }
  return sides;
}

}  // namespace

const char* to_string(Household thing) { return kThings[static_cast<std::size_t>(thing)].name; }

SceneObject household_object(Household thing, std::string name, double friction) {
  constexpr double kBottom = 0.006;  // m, of the bowl
  const Thing& known = kThings[static_cast<std::size_t>(thing)];
  SceneObject object{.name = std::move(name), .size = known.box, .mass = known.mass, .friction = friction};
  if (known.radius == 0) return object;
  object.shape = Shape::kCylinder;
  object.radius = known.radius;
  object.height = known.height;
  if (thing == Household::kMug) object.parts = {handle(known)};
  if (thing == Household::kBowl) {
    object.height = kBottom;
    object.parts = wall(known, kBottom);
  }
  return object;
}

}  // namespace jostle::physics_pool
