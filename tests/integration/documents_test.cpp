// Documents that say what the code says are made by the code, and lead where they say.

#include <gmock/gmock.h>

#include <algorithm>
#include <regex>

#include "services/wire/dds/topics.hpp"
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

TEST(Documents, NameEveryTopic) {
  const std::string document = contents(kSource / "docs" / "topics.md");
  std::apply(
      [&](const auto&... topic) {
        for (const std::string& name : {std::string(topic.name)...}) {
          const std::string last = name.substr(name.rfind('/') + 1);
          EXPECT_TRUE(document.find("`/" + name.substr(3) + "`") != std::string::npos ||
                      document.find("`" + last + "`") != std::string::npos)
              << name;
        }
      },
      wire::topics::all());
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

}  // namespace
}  // namespace jostle::tests
