#include "services/common/process/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class TemporaryFolder : public testing::Test {
 protected:
  TemporaryFolder() { setenv("TMPDIR", place.path().c_str(), 1); }
  ~TemporaryFolder() override {
    if (before.empty()) {
      unsetenv("TMPDIR");
    } else {
      setenv("TMPDIR", before.c_str(), 1);
    }
  }

  // Made by a process that is gone, or whose end nobody has waited for.
  fs::path made_by_another(const std::string& purpose) const {
    const pid_t child = fork();
    if (child == 0) _exit(make_temporary_folder(purpose) ? 0 : 1);
    int status = -1;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
    fs::path newest;
    for (const auto& entry : fs::directory_iterator(place.path())) newest = entry.path();
    return newest;
  }

  const std::string before = std::getenv("TMPDIR") ? std::getenv("TMPDIR") : "";
  const tests::TempFolder place;
};

TEST_F(TemporaryFolder, IsThisUsersOnly) {
  const auto sut = make_temporary_folder("test");
  ASSERT_TRUE(sut) << sut.error().message;
  EXPECT_EQ(sut->parent_path(), place.path());
  EXPECT_THAT(sut->filename().string(), testing::StartsWith("jostle-test-"));
  EXPECT_EQ(fs::status(*sut).permissions(), fs::perms::owner_all);
}

TEST_F(TemporaryFolder, OfSomebodyWhoIsGoneIsRemovedByTheNextOfItsPurpose) {
  const fs::path left = made_by_another("test");
  std::ofstream(left / "scene.yaml") << "x";
  const auto other = make_temporary_folder("other");
  EXPECT_TRUE(fs::exists(left));  // not ours to judge
  const auto sut = make_temporary_folder("test");
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(*sut) && fs::exists(*other));
}

TEST_F(TemporaryFolder, OfSomebodyWhoIsThereStays) {
  const auto first = make_temporary_folder("test");
  made_by_another("test");
  EXPECT_TRUE(fs::exists(*first));
}

TEST_F(TemporaryFolder, SweepsNothingButItsOwnKind) {
  const fs::path file = place.write("jostle-test-file12", "x");
  fs::create_directory(place.path() / "jostle-test-of-another-length");
  fs::create_directory_symlink("/", place.path() / "jostle-test-link12");
  ASSERT_TRUE(make_temporary_folder("test"));
  EXPECT_TRUE(fs::exists(file));
  EXPECT_TRUE(fs::exists(place.path() / "jostle-test-of-another-length"));
  EXPECT_TRUE(fs::is_symlink(place.path() / "jostle-test-link12"));
}

TEST_F(TemporaryFolder, NamesTheVariableAndItsValueWhereThereIsNoPlace) {
  setenv("TMPDIR", "/nonexistent", 1);
  const auto sut = make_temporary_folder("test");
  ASSERT_FALSE(sut);
  EXPECT_EQ(sut.error().code, Code::kIo);
  EXPECT_THAT(sut.error().message, HasSubstr("TMPDIR: got '/nonexistent', wanted a folder"));
}

}  // namespace
}  // namespace jostle::common
