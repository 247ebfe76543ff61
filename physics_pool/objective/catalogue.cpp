#include "physics_pool/objective/catalogue.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "physics_pool/objective/objective.hpp"
#include "physics_pool/objective/terms.hpp"
#include "physics_pool/task/state_distance.hpp"

namespace jostle::physics_pool {
namespace {

using Values = std::span<const double>;

const TermKind kAcceleration{.name = "acceleration",
                             .unit = "per (m/s)^2 or (rad/s)^2",
                             .weight = 0.1,
                             .meaning = "w_a of Eq. 3.2, w_u of Eq. 6.10: squared change of control",
                             .running = [](const Step& s, Values) { return acceleration_cost(s.u_before, s.u); }};

const TermKind kDisturbance{
    .name = "disturbance",
    .unit = "1/m^2",
    .weight = 800.0,
    .meaning = "w_d of Eq. 3.2: how far other objects than the target are moved, squared",
    .parameters = {{.name = "rotation",
                    .unit = "m^2/rad^2",
                    .initial = 0.0,
                    .meaning =
                        "weight of a squared rotation against a squared translation; 0 counts only translations"}},
    .running = [](const Step& s, Values v) { return disturbance_cost(s.geometry, s.x0, s.x1, v[0]); }};

const TermKind kEdge{
    .name = "edge",
    .unit = "1",
    .weight = 1.0,
    .meaning = "w_e of Eq. 3.2: objects that move outside the surface's safe zone",
    .parameters = {{.name = "rate", .unit = "1/m", .initial = 1000.0, .meaning = "k, of the exponent k·d_E"},
                   {.name = "exponent_max",
                    .unit = "1",
                    .initial = 6.0,
                    .meaning = "cap of the exponent, which reaches 50 in one step without it"},
                   {.name = "margin",
                    .unit = "m",
                    .initial = 0.05,
                    .meaning = "the safe zone is the surface less this much along its border"}},
    .running = [](const Step& s, Values v) {
      return edge_cost(s.geometry, s.x0, s.x1, {.rate = v[0], .exponent_max = v[1], .margin = v[2]});
    }};

const TermKind kTopple{
    .name = "topple",
    .unit = "1",
    .weight = 2000.0,
    .meaning = "per toppled object and step, once it lies (Eq. 4.37)",
    .parameters = {{.name = "angle",
                    .unit = "rad",
                    .initial = 0.5,
                    .most = std::numbers::pi,
                    .meaning = "tilt above which an object counts as toppled"}},
    .running = [](const Step& s, Values v) -> double { return toppled_objects(s.geometry, s.x1, v[0]); }};

const TermKind kDrop{
    .name = "drop",
    .unit = "1",
    .weight = 20000.0,
    .meaning = "per dropped object and step, once it has fallen; W_E of Sec. 7.3",
    .parameters = {{.name = "height",
                    .unit = "m",
                    .initial = 0.02,
                    .meaning = "below its resting height at which an object counts as dropped"}},
    .running = [](const Step& s, Values v) -> double { return count_dropped(s.geometry, s.x1, v[0]); }};

const TermKind kObstacle{
    .name = "obstacle",
    .unit = "1",
    .weight = 1.0,
    .meaning = "Eq. 6.10: target and pusher near the keep-out area",
    .parameters =
        {{.name = "target", .unit = "m^2", .initial = 5.0, .meaning = "w_s, over the target's squared distance"},
         {.name = "pusher", .unit = "m^2", .initial = 1.0, .meaning = "w_p, over the pusher's squared distance"},
         {.name = "nearest",
          .unit = "m",
          .initial = 0.02,
          .least = 1e-3,
          .meaning = "centres closer than this count as this far apart, so that costs stay finite"}},
    .running = [](const Step& s, Values v) {
      return obstacle_cost(s.geometry, s.x1, {.target = v[0], .pusher = v[1], .nearest = v[2]});
    }};

// Eq. 6.10 has nothing of the kind: without it a plan through the obstacle that ends at the goal is a success.
const TermKind kCollision{
    .name = "collision",
    .unit = "1",
    .weight = 20000.0,
    .meaning = "per step with the target, or the pusher, over the obstacle, and for each of them",
    .running = [](const Step& s, Values) -> double { return count_collisions(s.geometry, s.x1); }};

const TermKind kIntrusion{.name = "intrusion",
                          .unit = "1",
                          .weight = 20000.0,
                          .meaning = "per other object in the goal region and step (Sec. 7.3)",
                          .running = [](const Step& s, Values) -> double { return count_intruders(s.geometry, s.x1); }};

const TermKind kContact{.name = "contact",
                        .unit = "1",
                        .weight = 0.0,
                        .meaning = "c_c of Eq. 4.36: per step in which any link of the robot touches a fixture",
                        .running = [](const Step& s, Values) { return s.facts.robot_hit_fixture ? 1.0 : 0.0; }};

const TermKind kGoal{
    .name = "goal",
    .unit = "1/m^2",
    .weight = 10000.0,
    .meaning = "w_g of Eq. 3.2, w of Eq. 6.10: the task's distance from its end, squared",
    .parameters = {{.name = "angle", .unit = "m^2/rad^2", .initial = 1.0, .meaning = "w_phi; a push has no bearing"}},
    .final = [](const TaskGeometry& g, const State& x, Values v) { return g.kind->cost(g, x, v[0]); }};

// What lodges between palm and target pushes the target ahead of the hand for ever.
const TermKind kObstruction{
    .name = "obstruction",
    .unit = "1",
    .weight = 1000.0,
    .meaning = "per other object whose centre is in the hand at the end",
    .final = [](const TaskGeometry& g, const State& x, Values) -> double { return count_obstructions(g, x); }};

// k_act of Eq. 5.4: what an action costs is its time.
const TermKind kAction{.name = "action",
                       .unit = "1",
                       .weight = 0.0,
                       .meaning = "k_act of Eq. 5.4: per action, whatever it does",
                       .running = [](const Step&, Values) { return 1.0; }};

const TermKind kRim{
    .name = "rim",
    .unit = "1",
    .weight = 0.0,
    .meaning = "w_e of Eq. 5.4: like edge, with a safe zone for each object's own size, for objects that were moved",
    .parameters = {{.name = "rate", .unit = "1/m", .initial = 25.0, .meaning = "k, of the exponent k·d_E"},
                   {.name = "exponent_max",
                    .unit = "1",
                    .initial = 20.0,
                    .meaning = "cap of the exponent; one that pushes reach would make a fast push no dearer than a "
                               "slow one"},
                   {.name = "margin",
                    .unit = "m",
                    .initial = 0.01,
                    .meaning = "least distance of a safe object's footprint, as a disc, from the surface's border"},
                   {.name = "still",
                    .unit = "m",
                    .initial = 0.001,
                    .meaning = "an object that moved less than this was not moved"}},
    .running = [](const Step& s, Values v) {
      return rim_cost(s.geometry, s.x0, s.x1, {.rate = v[0], .exponent_max = v[1], .margin = v[2], .still = v[3]});
    }};

const TermKind kMiss{
    .name = "miss",
    .unit = "1/m^2",
    .weight = 0.0,
    .meaning =
        "w_f of Eq. 5.5, a push's terminal cost of Sec. 5.4: how far outside the goal region the target is, "
        "squared; 0 for tasks without a region",
    .final = [](const TaskGeometry& g, const State& x, Values) { return miss_cost(g, x); }};

const TermKind kPads{
    .name = "pads",
    .unit = "1/m^2",
    .weight = 0.0,
    .meaning =
        "v_f of Eq. 4.29 with c_g of Eq. 4.39: the target's distance from between the pads, squared; a robot "
        "without a hand has none",
    .parameters = {{.name = "angle",
                    .unit = "m^2/rad^2",
                    .initial = 0.019,
                    .meaning = "w_phi of Eq. 4.39, of the target's bearing from the palm, squared"}},
    .final = [](const TaskGeometry& g, const State& x, Values v) { return pads_cost(g, x, v[0]); }};

const TermKind kState{
    .name = "state",
    .unit = "1/m",
    .weight = 0.0,
    .meaning = "v_f of Eq. 4.29 where Eq. 4.41 has a wanted state x^d: the distance from it; who plans gives x^d",
    .final = [](const TaskGeometry& g, const State& x, Values v) { return state_distance(g, x.q, v); },
    .takes_state = true};

// Sums are made in this order: it is part of the last bit of every cost.
std::vector<const TermKind*>& catalogue() {
  static std::vector<const TermKind*> kinds{
      &kAcceleration, &kDisturbance, &kEdge,        &kTopple, &kDrop, &kObstacle, &kCollision, &kIntrusion,
      &kContact,      &kGoal,        &kObstruction, &kAction, &kRim,  &kMiss,     &kPads,      &kState};
  return kinds;
}

Term make_term(const TermKind& kind, double weight) {
  Term term{.kind = kind.name, .weight = weight};
  for (const TermParameter& parameter : kind.parameters) term.values.push_back(parameter.initial);
  return term;
}

std::size_t index_of(const TermKind& kind, std::string_view parameter) {
  const auto found = std::ranges::find(kind.parameters, parameter, &TermParameter::name);
  return static_cast<std::size_t>(found - kind.parameters.begin());
}

}  // namespace

std::span<const TermKind* const> term_catalogue() { return catalogue(); }

const TermKind* find_term_kind(std::string_view name) {
  const auto found = std::ranges::find(catalogue(), name, &TermKind::name);
  return found == catalogue().end() ? nullptr : *found;
}

void add_term_kind(const TermKind& kind) { catalogue().push_back(&kind); }

Objective Objective::standard() {
  Objective objective;
  for (const TermKind* kind : term_catalogue()) objective.terms.push_back(make_term(*kind, kind->weight));
  return objective;
}

Term& Objective::operator[](std::string_view kind) {
  const auto found = std::ranges::find(terms, kind, &Term::kind);
  if (found != terms.end()) return *found;
  return terms.emplace_back(make_term(*find_term_kind(kind), 0.0));
}

const Term* Objective::find(std::string_view kind) const {
  const auto found = std::ranges::find(terms, kind, &Term::kind);
  return found == terms.end() ? nullptr : &*found;
}

double Objective::weight(std::string_view kind) const {
  const Term* term = find(kind);
  return term ? term->weight : 0.0;
}

double Objective::value(std::string_view kind, std::string_view parameter) const {
  const TermKind& row = *find_term_kind(kind);
  const std::size_t i = index_of(row, parameter);
  const Term* term = find(kind);
  return term ? term->values.at(i) : row.parameters.at(i).initial;
}

double& Objective::value(std::string_view kind, std::string_view parameter) {
  return (*this)[kind].values.at(index_of(*find_term_kind(kind), parameter));
}

Result<void> validate(const Objective& objective) {
  const auto check = [](const std::string& field, double value, const char* unit, double least,
                        double most) -> Result<void> {
    if (value >= least && value <= most && std::isfinite(value)) return {};
    std::string wanted = fmt::format("a finite number >= {}", least);
    if (most < std::numeric_limits<double>::max()) wanted += fmt::format(" and <= {:.4g}", most);
    wanted += least > 0 ? ", or costs could be infinite" : ", or rollouts could not be stopped early";
    return invalid("objective." + field, fmt::format("{} {}", value, unit), wanted);
  };
  std::set<std::string_view> seen;
  for (const Term& term : objective.terms) {
    const TermKind* kind = find_term_kind(term.kind);
    if (!kind) {
      std::vector<std::string_view> known;
      for (const TermKind* k : term_catalogue()) known.emplace_back(k->name);
      return invalid("objective.terms", "'" + term.kind + "'", fmt::format("one of: {}", fmt::join(known, ", ")));
    }
    if (!seen.insert(term.kind).second) return invalid("objective." + term.kind, "it twice", "it once");
    if (!kind->takes_state && term.values.size() != kind->parameters.size()) {
      return invalid("objective." + term.kind, fmt::format("{} parameters", term.values.size()),
                     std::to_string(kind->parameters.size()));
    }
    if (auto ok = check(term.kind, term.weight, kind->unit, 0.0, std::numeric_limits<double>::max()); !ok) return ok;
    if (kind->takes_state && !std::ranges::all_of(term.values, [](double v) { return std::isfinite(v); })) {
      return invalid("objective." + term.kind, "a position that is infinite or NaN", "finite ones");
    }
    for (std::size_t i = 0; i < kind->parameters.size(); ++i) {
      const TermParameter& p = kind->parameters[i];
      if (auto ok = check(term.kind + "_" + p.name, term.values[i], p.unit, p.least, p.most); !ok) return ok;
    }
  }
  return check("success_cost", objective.success_cost, "", 0.0, std::numeric_limits<double>::max());
}

}  // namespace jostle::physics_pool
