#include "services/task/config/predictor.hpp"

#include <fmt/format.h>

#include <array>
#include <climits>
#include <optional>
#include <sstream>
#include <vector>

#include "idl/text/nearest.hpp"
#include "idl/types/number.hpp"
#include "services/common/process/files.hpp"

namespace jostle::task {
namespace {

Error unknown(const std::string& text) {
  constexpr std::array kMethods{"fine", "coarse", "parareal"};
  return {Code::kInvalidArgument,
          fmt::format("predictor: got '{}', wanted fine, coarse[,MODEL], parareal:K[,MODEL][,split] or "
                      "parareal:adaptive[,MODEL][,split]{}",
                      text, did_you_mean(text.substr(0, text.find_first_of(":,")), kMethods))};
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

// Nothing: the fine model.
Result<std::optional<physics_pool::PararealOptions>> parse(const std::string& text) {
  std::vector<std::string> words = words_of(text);
  if (words.empty()) return unknown(text);
  if (words == std::vector<std::string>{"fine"}) return std::optional<physics_pool::PararealOptions>{};
  physics_pool::PararealOptions options;
  const std::string method = words.front();
  words.erase(words.begin());
  constexpr std::string_view kParareal = "parareal:";
  if (method.starts_with(kParareal)) {
    const std::string_view times = std::string_view(method).substr(kParareal.size());
    const auto iterations = parse_whole(times, 1, INT_MAX);
    options.stop.adaptive = times == "adaptive";
    if (!iterations && !options.stop.adaptive) return unknown(text);
    options.stop.iterations = iterations.value_or(INT_MAX);
    if (!words.empty() && words.back() == "split") {
      options.split_by_itself = true;
      words.pop_back();
    }
  } else if (method == "coarse") {
    options.stop.iterations = 0;
  } else {
    return unknown(text);
  }
  if (words.size() > 1) return unknown(text);
  if (!words.empty()) options.model = common::coarse_model_name(words.front());
  return std::optional(std::move(options));
}

}  // namespace

Result<Predictor> Predictor::make(const std::string& text, physics_pool::AsyncPool& pool,
                                  std::function<void(const std::string&)> on_split) {
  auto options_result = parse(text);
  if (!options_result) return options_result.error();
  Predictor predictor(pool);
  if (!*options_result) return predictor;
  (*options_result)->on_split = std::move(on_split);
  predictor.parareal_ = std::make_unique<physics_pool::PararealPool>(pool, **std::move(options_result));
  return predictor;
}

Result<void> Predictor::check(const std::string& text, const physics_pool::Scene& scene) {
  auto options_result = parse(text);
  if (!options_result) return options_result.error();
  if (!*options_result) return {};
  auto model_result = physics_pool::make_coarse_model((*options_result)->model, scene);
  if (!model_result) return Error{model_result.error().code, "predictor: " + model_result.error().message};
  return {};
}

}  // namespace jostle::task
