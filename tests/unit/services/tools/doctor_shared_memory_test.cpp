// In folders of their own: what lies in /dev/shm may be anybody's.

#include "services/tools/doctor/shared_memory.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/mman.h>
#include <unistd.h>

#include "tests/support/temp_folder.hpp"

namespace jostle::tools {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class DoctorLeftovers : public testing::Test {
 protected:
  std::vector<Leftover> found() const { return find_leftovers({.folder = folder.path(), .settled = {}}); }

  std::vector<std::string> names() const {
    std::vector<std::string> result;
    for (const Leftover& leftover : found()) result.push_back(leftover.name);
    return result;
  }

  const tests::TempFolder folder;
};

TEST_F(DoctorLeftovers, AreSegmentsPortsAndDataSharingOfFastDds) {
  folder.write("fastrtps_0123456789abcdef", "");
  folder.write("fastrtps_port7413", "");
  folder.write("fast_datasharing_01.0f", "");
  folder.write("sem.fastrtps_port9999_mutex", "");
  folder.write("somebody_elses", "");
  folder.write("sem.somebody_elses", "");
  folder.write("my_fastrtps_notes", "");

  EXPECT_THAT(names(), UnorderedElementsAre("fastrtps_0123456789abcdef", "fastrtps_port7413", "fast_datasharing_01.0f",
                                            "fastrtps_port9999"));
}

TEST_F(DoctorLeftovers, HaveTheirLocksAndSemaphoresWithThem) {
  folder.write("fastrtps_port7413", std::string(100, 'x'));
  folder.write("fastrtps_port7413_el", "12345");
  folder.write("fastrtps_port7413_sl", "");
  folder.write("sem.fastrtps_port7413_mutex", std::string(32, 'x'));
  folder.write("fastrtps_port74130", "");

  const auto leftovers = found();

  ASSERT_EQ(leftovers.size(), 2u);
  EXPECT_EQ(leftovers[0].name, "fastrtps_port7413");
  EXPECT_EQ(leftovers[0].bytes, 137u);
  EXPECT_THAT(
      leftovers[0].files,
      UnorderedElementsAre(folder.path() / "fastrtps_port7413", folder.path() / "fastrtps_port7413_el",
                           folder.path() / "fastrtps_port7413_sl", folder.path() / "sem.fastrtps_port7413_mutex"));
}

TEST_F(DoctorLeftovers, AreNotWhatSomebodyHasOpen) {
  folder.write("fastrtps_abandoned", "");
  folder.write("fastrtps_open", "");
  const fs::path lock = folder.write("fastrtps_open_el", "");  // one file of several is enough
  const int descriptor = open(lock.c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_GE(descriptor, 0);

  EXPECT_THAT(names(), ElementsAre("fastrtps_abandoned"));

  close(descriptor);
  EXPECT_THAT(names(), UnorderedElementsAre("fastrtps_abandoned", "fastrtps_open"));
}

TEST_F(DoctorLeftovers, AreNotWhatSomebodyMaps) {
  constexpr std::size_t kBytes = 4096;
  const fs::path segment = folder.write("fastrtps_mapped", std::string(kBytes, 'x'));
  const int descriptor = open(segment.c_str(), O_RDONLY | O_CLOEXEC);
  void* memory = mmap(nullptr, kBytes, PROT_READ, MAP_SHARED, descriptor, 0);
  close(descriptor);
  ASSERT_NE(memory, MAP_FAILED);

  EXPECT_THAT(names(), IsEmpty());

  munmap(memory, kBytes);
  EXPECT_THAT(names(), ElementsAre("fastrtps_mapped"));
}

TEST_F(DoctorLeftovers, AreNotWhatMayBeHalfMade) {
  folder.write("fastrtps_new", "");
  EXPECT_THAT(find_leftovers({.folder = folder.path(), .settled = std::chrono::hours(1)}), IsEmpty());
  EXPECT_THAT(names(), ElementsAre("fastrtps_new"));
}

TEST_F(DoctorLeftovers, AreRemovedWithEverythingAndNothingElse) {
  folder.write("fastrtps_port7413", "");
  folder.write("sem.fastrtps_port7413_mutex", "");
  const fs::path other = folder.write("somebody_elses", "");

  remove_leftovers(found());

  EXPECT_THAT(names(), IsEmpty());
  EXPECT_TRUE(fs::exists(other));
  EXPECT_FALSE(fs::exists(folder.path() / "sem.fastrtps_port7413_mutex"));
}

TEST_F(DoctorLeftovers, RemovedByAnotherMeanwhileAreNoTrouble) {
  const fs::path file = folder.write("fastrtps_gone", "");
  const auto leftovers = found();
  ASSERT_EQ(leftovers.size(), 1u);
  fs::remove(file);
  remove_leftovers(leftovers);
  EXPECT_THAT(names(), IsEmpty());
}

TEST_F(DoctorLeftovers, OfAFolderThatIsNotThereAreNone) {
  EXPECT_THAT(find_leftovers({.folder = folder.path() / "nowhere", .settled = {}}), IsEmpty());
}

// Whatever this machine is like: a remedy where one is needed, and nowhere else.
TEST(DoctorSharedMemory, FindingsHaveARemedyUnlessAllIsWell) {
  for (const Check& check : {check_shared_memory(), check_leftovers()}) {
    EXPECT_FALSE(check.finding.empty()) << check.name;
    EXPECT_EQ(check.remedy.empty(), check.verdict == Verdict::kOk) << check.name << ": " << check.finding;
  }
  EXPECT_EQ(check_shared_memory().name, "shared memory");
  EXPECT_EQ(check_leftovers().name, "leftovers");
}

}  // namespace
}  // namespace jostle::tools
