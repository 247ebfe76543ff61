// Documents that say what the code says are made by the code, and lead where they say.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>

#include "services/wire/dds/names.hpp"
#include "services/wire/dds/system_topics.hpp"
#include "tests/support/program_process.hpp"

namespace jostle::tests {
namespace {

using ::testing::HasSubstr;
using std::chrono_literals::operator""s;

const std::filesystem::path kSource = JOSTLE_SOURCE_DIR;

// Every document of the tree: not those of what was built or run beside it.
std::vector<std::filesystem::path> documents() {
  std::vector<std::filesystem::path> found;
  for (auto entry = std::filesystem::recursive_directory_iterator(kSource);
       entry != std::filesystem::recursive_directory_iterator(); ++entry) {
    const std::string name = entry->path().filename();
    if (entry->is_directory() && (name.starts_with(".") || name.starts_with("build") || name == "run")) {
      entry.disable_recursion_pending();
    } else if (entry->path().extension() == ".md") {
      found.push_back(entry->path());
    }
  }
  return found;
}

// The headings of a document as links spell them: "## What takes how long" is what-takes-how-long.
std::vector<std::string> anchors(const std::string& document) {
  std::vector<std::string> found;
  static const std::regex heading("(^|\n)#+ ([^\n]*)");
  for (std::sregex_iterator match(document.begin(), document.end(), heading), end; match != end; ++match) {
    std::string anchor;
    for (const char c : (*match)[2].str()) {
      if (c == ' ') anchor += '-';
      if (std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_')
        anchor += static_cast<char>(std::tolower(c));
    }
    found.push_back(anchor);
  }
  return found;
}

// docs/parameters.md holds `jostle parameters --markdown`.
TEST(Documents, OfParametersHoldTheTableOfTheCode) {
  const TempFolder folder;
  ProgramProcess program("jostle_parameters", {"--markdown"}, folder);
  ASSERT_EQ(program.wait(60s), 0) << program.err();

  const std::string document = contents(kSource / "docs" / "parameters.md");

  EXPECT_THAT(document, HasSubstr(program.out())) << "put what `jostle parameters --markdown` prints there";
}

// What of a topic's row in docs/topics.md follows from the code.
std::string row_of(const wire::SystemTopic& topic) {
  return fmt::format("| `{}` | `{}` | {} | {}, {}, {} |", wire::ros_topic(topic.name).value(),
                     wire::ros_type(topic.type).value(), topic.scope == wire::Scope::kRobot ? "robot" : "domain",
                     topic.qos.reliable ? "reliable" : "best effort",
                     topic.qos.latched || topic.qos.retained ? "transient local" : "volatile",
                     topic.qos.depth == kKeepAll ? "all" : fmt::format("last {}", topic.qos.depth));
}

TEST(Documents, SayOfEveryTopicWhatTheCodeSays) {
  const std::string document = contents(kSource / "docs" / "topics.md");
  for (const wire::SystemTopic& topic : wire::system_topics()) EXPECT_THAT(document, HasSubstr("\n" + row_of(topic)));
}

// A path of Foxglove's, "/task/feedback.cost", begins with a topic.
TEST(Documents, OfFoxglovesLayoutNameTopicsThatAreThere) {
  const std::string layout = contents(kSource / "docs" / "jostle.foxglove.json");
  std::vector<std::string> topics;
  for (const wire::SystemTopic& topic : wire::system_topics()) topics.push_back(wire::ros_topic(topic.name).value());
  static const std::regex name(R"re("(/[a-z_/]+))re");
  std::size_t named = 0;
  for (std::sregex_iterator match(layout.begin(), layout.end(), name), end; match != end; ++match, ++named)
    EXPECT_THAT(topics, ::testing::Contains((*match)[1].str()));
  EXPECT_GE(named, 8u);
}

TEST(Documents, LeadWhereTheySay) {
  const auto all = documents();
  ASSERT_GT(all.size(), 20u);
  static const std::regex link(R"(\]\(([^)\s#]*)(#([^)\s]*))?\))");
  for (const auto& file : all) {
    const std::string text = contents(file);
    for (std::sregex_iterator match(text.begin(), text.end(), link), end; match != end; ++match) {
      const std::string path = (*match)[1], anchor = (*match)[3];
      if (path.starts_with("http")) continue;
      const auto target = path.empty() ? file : file.parent_path() / path;
      EXPECT_TRUE(std::filesystem::exists(target)) << file << " links to " << path;
      if (anchor.empty() || target.extension() != ".md") continue;
      EXPECT_THAT(anchors(contents(target)), ::testing::Contains(anchor)) << file << " links to " << path;
    }
  }
}

// All numbers of a result, in its own units and as per cent or thousandths of them; those of single runs left out.
std::vector<double> numbers_of(const nlohmann::json& value) {
  std::vector<double> found;
  if (value.is_number()) {
    for (const double unit : {1.0, 100.0, 1000.0}) found.push_back(unit * value.get<double>());
  }
  for (const auto& [key, element] : value.items()) {
    if (!value.is_structured() || key == "provenance" || key == "runs" || key == "values") continue;
    std::ranges::copy(numbers_of(element), std::back_inserter(found));
  }
  return found;
}

// A table below "<!-- numbers of NAME.json … -->" has, but for its head and first column, no number that is not in one
// of these files of experiments/results, rounded to the digits that it shows.
TEST(Documents, TablesHoldTheNumbersOfTheirResults) {
  static const std::regex mark("<!-- numbers of ([^>]*) -->\\s*\n[^\n]*\n[^\n]*\n((\\|[^\n]*\n)+)"),
      file(R"(\S+\.json)"), first_cell(R"((^|\n)\|[^|]*\|)"), number(R"(\d[\d,]*\d(\.\d+)?|\d(\.\d+)?)");
  int tables = 0;
  for (const auto& document : documents()) {
    const std::string text = contents(document);
    for (std::sregex_iterator table(text.begin(), text.end(), mark), end; table != end; ++table) {
      ++tables;
      std::vector<double> known;
      const std::string names = (*table)[1], body = std::regex_replace((*table)[2].str(), first_cell, "$1|");
      for (std::sregex_iterator name(names.begin(), names.end(), file); name != end; ++name) {
        const auto json = nlohmann::json::parse(contents(kSource / "experiments" / "results" / name->str()));
        std::ranges::copy(numbers_of(json), std::back_inserter(known));
      }
      for (std::sregex_iterator cell(body.begin(), body.end(), number); cell != end; ++cell) {
        std::string digits = cell->str();
        std::erase(digits, ',');
        const std::size_t point = digits.find('.');
        const double place = std::pow(10.0, point == std::string::npos ? 0.0 : point + 1.0 - digits.size());
        const double shown = std::stod(digits);
        EXPECT_TRUE(std::ranges::any_of(
            known, [&](double value) { return std::abs(std::abs(value) - shown) <= 0.5000001 * place; }))
            << document << ": " << cell->str() << " is not in " << names;
      }
    }
  }
  EXPECT_GE(tables, 3);
}

}  // namespace
}  // namespace jostle::tests
