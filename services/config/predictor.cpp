#include "services/config/predictor.hpp"

#include <fmt/format.h>

#include <charconv>
#include <climits>
#include <sstream>
#include <vector>

#include "services/support/files.hpp"

namespace jostle::services {
namespace {

Error unknown(const std::string& text) {
  return {Code::kInvalidArgument,
          fmt::format("predictor: got '{}', wanted fine, coarse[,MODEL], parareal:K[,MODEL][,split] or "
                      "parareal:adaptive[,MODEL][,split]", text)};
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

}  // namespace

Result<Predictor> Predictor::make(const std::string& text, physics_pool::AsyncPool& pool,
                                  std::function<void(const std::string&)> on_split) {
  Predictor predictor(pool);
  std::vector<std::string> words = words_of(text);
  if (words.empty()) return unknown(text);
  if (words == std::vector<std::string>{"fine"}) return predictor;
  physics_pool::PararealOptions options{.on_split = std::move(on_split)};
  const std::string method = words.front();
  words.erase(words.begin());
  constexpr std::string_view kParareal = "parareal:";
  if (method.starts_with(kParareal)) {
    const std::string_view times = std::string_view(method).substr(kParareal.size());
    const auto [end, problem] = std::from_chars(times.data(), times.data() + times.size(), options.stop.iterations);
    options.stop.adaptive = times == "adaptive";
    if (options.stop.adaptive) options.stop.iterations = INT_MAX;
    const bool is_number = problem == std::errc{} && end == times.data() + times.size() && options.stop.iterations > 0;
    if (!is_number && !options.stop.adaptive) return unknown(text);
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
  if (!words.empty()) options.model = coarse_model_name(words.front());
  predictor.parareal_ = std::make_unique<physics_pool::PararealPool>(pool, std::move(options));
  return predictor;
}

}  // namespace jostle::services
