#include "services/common/process/files.hpp"

#include <gtest/gtest.h>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

namespace fs = std::filesystem;

TEST(ShareFolder, LiesBesideTheProgramsOfABuild) {
  const tests::TempFolder folder;
  fs::create_directories(folder.path() / "bin");
  fs::create_directories(folder.path() / "share/jostle");

  EXPECT_EQ(share_folder(folder.path() / "bin"), folder.path() / "share/jostle");
}

TEST(ShareFolder, LiesFurtherUpWhenProgramsHaveAFolderOfTheirOwn) {
  const tests::TempFolder folder;
  fs::create_directories(folder.path() / "libexec/jostle");
  fs::create_directories(folder.path() / "libexec/share/other");
  fs::create_directories(folder.path() / "share/jostle");

  EXPECT_EQ(share_folder(folder.path() / "libexec/jostle"), folder.path() / "share/jostle");
}

TEST(ShareFolder, NearestWins) {
  const tests::TempFolder folder;
  fs::create_directories(folder.path() / "share/jostle");
  fs::create_directories(folder.path() / "build/share/jostle");

  EXPECT_EQ(share_folder(folder.path() / "build/bin"), folder.path() / "build/share/jostle");
}

TEST(ShareFolder, NamesTheOneBesideWhenThereIsNone) {
  EXPECT_EQ(share_folder("/nowhere/bin"), fs::path("/nowhere/share/jostle"));
}

}  // namespace
}  // namespace jostle::common
