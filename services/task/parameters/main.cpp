// jostle parameters: every key that parameter files have, what it means, and what runs do without one.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "idl/text/nearest.hpp"
#include "services/common/process/program.hpp"
#include "services/task/config/parameter_keys.hpp"

namespace jostle::task {
namespace {

// The parameters of a kind of task, by the name of their file.
struct Standard {
  std::string name;  // "grasping"
  Parameters parameters;
};

Result<std::vector<Standard>> load_standards() {
  std::vector<Standard> standards;
  for (const planners::ControllerKind* controller : planners::controllers()) {
    const std::string name = std::filesystem::path(controller->parameters).stem();
    if (std::ranges::find(standards, name, &Standard::name) != standards.end()) continue;
    auto parameters_result = standard_parameters(*controller);
    if (!parameters_result) return parameters_result.error();
    standards.push_back({.name = name, .parameters = std::move(parameters_result).value()});
  }
  return standards;
}

// "2 grasping, 20 pushing", or "1.0" where that is the same.
std::string values_of(const ParameterKey& key, const std::vector<Standard>& standards) {
  std::string text;
  bool all_equal = true;
  for (const Standard& standard : standards) {
    all_equal = all_equal && key.get(standard.parameters) == key.get(standards.front().parameters);
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", to_text(key.get(standard.parameters)), standard.name);
  }
  return all_equal ? to_text(key.get(standards.front().parameters)) : text;
}

std::string with_unit(const ParameterKey& key) {
  return key.unit.empty() || key.unit == "1" ? key.wanted() : key.wanted() + " " + key.unit;
}

void print_text(const std::vector<ParameterKey>& keys, const std::vector<Standard>& standards) {
  for (const ParameterKey& key : keys) {
    fmt::print("{:32} {}\n", key.path(), values_of(key, standards));
    fmt::print("    {} Wanted: {}.\n", key.meaning, with_unit(key));
  }
}

void print_markdown(const std::vector<ParameterKey>& keys, const std::vector<Standard>& standards) {
  fmt::print("| key |");
  for (const Standard& standard : standards) fmt::print(" {} |", standard.name);
  fmt::print(" wanted | what it is |\n|---|");
  for (std::size_t i = 0; i < standards.size(); ++i) fmt::print("---|");
  fmt::print("---|---|\n");
  for (const ParameterKey& key : keys) {
    fmt::print("| `{}` |", key.path());
    for (const Standard& standard : standards) fmt::print(" {} |", to_text(key.get(standard.parameters)));
    fmt::print(" {} | {} |\n", with_unit(key), key.meaning);
  }
}

nlohmann::json as_json(const ParameterValue& value) {
  return std::visit([](const auto& v) { return nlohmann::json(v); }, value);
}

void print_json(const std::vector<ParameterKey>& keys, const std::vector<Standard>& standards) {
  nlohmann::json list = nlohmann::json::array();
  for (const ParameterKey& key : keys) {
    nlohmann::json one{{"key", key.path()}, {"unit", key.unit}, {"wanted", key.wanted()}, {"meaning", key.meaning}};
    for (const Standard& standard : standards) one["defaults"][standard.name] = as_json(key.get(standard.parameters));
    list.push_back(std::move(one));
  }
  fmt::print("{}\n", list.dump(1));
}

}  // namespace
}  // namespace jostle::task

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::task;
  CLI::App app(
      "Lists the parameters of planners and controllers: what each is, its unit and range, and its value in\n"
      "`jostle run` where nobody says anything else. A file given to --parameters changes what it names, and so\n"
      "does --set KEY=VALUE.",
      "jostle parameters");
  std::vector<std::string> wanted;
  bool json = false, markdown = false;
  std::string file_of;
  app.add_option("keys", wanted, "Keys, or sections such as planner (default: all)");
  app.add_flag("--json", json, "Print JSON");
  app.add_flag("--markdown", markdown, "Print a table as docs/parameters.md has it");
  app.add_option("--file", file_of,
                 "Print a complete parameter file of this kind, grasping, pushing, robust or adaptive, to start from")
      ->excludes("keys");
  app.footer("Exit codes: 0 done, 2 an unknown key.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;

  auto standards_result = load_standards();
  const auto fail = [](const Error& error) {
    fmt::print(stderr, "jostle parameters: {}\n", error.message);
    return common::kExitUsage;
  };
  if (!standards_result) return fail(standards_result.error());
  if (!file_of.empty()) {
    const auto found = std::ranges::find(*standards_result, file_of, &Standard::name);
    if (found == standards_result->end())
      return fail(invalid("--file", "'" + file_of + "'", "grasping, pushing, robust or adaptive"));
    fmt::print("{}", to_yaml(found->parameters));
    return common::kExitOk;
  }
  std::vector<ParameterKey> keys = parameter_keys();
  for (const std::string& word : wanted) {
    if (std::ranges::any_of(keys, [&](const ParameterKey& key) { return key.path() == word || key.section == word; })) {
      continue;
    }
    std::set<std::string> known;
    for (const ParameterKey& key : keys) known.insert({key.path(), key.section});
    const std::string near = nearest(word, known);
    return fail(invalid(
        "keys", "'" + word + "'",
        "a key or a section; " + (near.empty() ? "`jostle parameters` lists all" : "did you mean " + near + "?")));
  }
  std::erase_if(keys, [&](const ParameterKey& key) {
    return !wanted.empty() && std::ranges::none_of(wanted, [&](const std::string& word) {
      return key.path() == word || key.section == word;
    });
  });
  if (json) {
    print_json(keys, *standards_result);
  } else if (markdown) {
    print_markdown(keys, *standards_result);
  } else {
    print_text(keys, *standards_result);
  }
  return common::kExitOk;
}
