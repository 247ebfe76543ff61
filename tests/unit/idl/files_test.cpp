#include "idl/files/files.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <future>

#include "tests/support/temp_folder.hpp"

namespace jostle::files {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Files : public testing::Test {
 protected:
  // Names of all there is.
  std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& entry : fs::directory_iterator(folder.path())) found.push_back(entry.path().filename());
    std::ranges::sort(found);
    return found;
  }

  const tests::TempFolder folder;
  const fs::path file = folder.path() / "a.json";
};

mode_t mode_of(const fs::path& path) {
  struct stat found {};
  EXPECT_EQ(lstat(path.c_str(), &found), 0) << path;
  return found.st_mode;
}

TEST_F(Files, AreMadeAndReplacedAndLeaveNothingBeside) {
  EXPECT_TRUE(write(file, "one"));
  EXPECT_TRUE(write(file, "two"));
  EXPECT_EQ(tests::contents(file), "two");
  EXPECT_EQ(names(), std::vector<std::string>{"a.json"});
}

TEST_F(Files, KeepTheirPermissionsWhenReplaced) {
  folder.write("a.json", "one");
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
  EXPECT_TRUE(write(file, "two"));
  EXPECT_EQ(mode_of(file) & 0777, 0640u);
}

TEST_F(Files, AreReplacedInOneStep) {
  folder.write("a.json", "one");
  const int reader = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  EXPECT_TRUE(write(file, "a longer text"));
  char bytes[8] = "";
  EXPECT_EQ(::read(reader, bytes, sizeof bytes), 3);  // whoever had it open has the old one
  close(reader);
}

TEST_F(Files, LinksStayAndWhatTheyLeadToIsWritten) {
  const fs::path link = folder.path() / "link", chain = folder.path() / "chain";
  fs::create_symlink("a.json", link);
  fs::create_symlink("link", chain);
  EXPECT_TRUE(write(chain, "made"));  // the end of the chain was missing
  EXPECT_EQ(tests::contents(file), "made");
  EXPECT_TRUE(write(chain, "replaced"));
  EXPECT_EQ(tests::contents(file), "replaced");
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_TRUE(fs::is_symlink(chain));
}

TEST_F(Files, LinkIntoItselfIsRefused) {
  fs::create_symlink("a.json", file);
  EXPECT_FALSE(write(file, "x"));
  EXPECT_FALSE(read(file));
}

TEST_F(Files, DevicesAreWrittenToAndStay) {
  fs::path device = folder.path() / "null";
  // Only root makes devices; for everybody else the machine's own does as well, as they could not replace it.
  if (mknod(device.c_str(), S_IFCHR | 0600, 1 << 8 | 3) != 0) device = "/dev/null";
  EXPECT_TRUE(check_outputs(std::vector<Output>{{"--json", device, {".json"}}}));
  EXPECT_TRUE(write(device, "gone"));
  EXPECT_TRUE(S_ISCHR(mode_of(device)));
}

TEST_F(Files, FullDeviceIsAnError) {
  const auto written = write("/dev/full", "x");
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, Code::kIo);
  EXPECT_THAT(written.error().message, AllOf(HasSubstr("/dev/full"), HasSubstr("No space left")));
}

TEST_F(Files, PipesAreWrittenToAndReadToTheEnd) {
  const fs::path pipe = folder.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const std::string text(200'000, 'x');  // more than a pipe holds
  auto reader = std::async(std::launch::async, [&] { return read(pipe); });
  EXPECT_TRUE(write(pipe, text));
  const auto read_result = reader.get();
  ASSERT_TRUE(read_result);
  EXPECT_EQ(*read_result, text);
  EXPECT_TRUE(S_ISFIFO(mode_of(pipe)));
}

TEST_F(Files, EmptyOnesAndThoseOfTheKernelAreRead) {
  EXPECT_EQ(read(folder.write("empty", "")).value(), "");
  EXPECT_EQ(read("/dev/null").value(), "");
  EXPECT_THAT(read("/proc/self/status").value(), HasSubstr("Name:"));
}

TEST_F(Files, ThatCannotBeReadAreNamedWithTheReason) {
  EXPECT_THAT(read(file).error().message, HasSubstr("a.json: missing"));
  EXPECT_EQ(read(file).error().code, Code::kNotFound);
  EXPECT_THAT(read(folder.path()).error().message, HasSubstr("it is a folder, wanted a file"));
  EXPECT_EQ(read(folder.path()).error().code, Code::kInvalidArgument);
}

TEST_F(Files, LargerThanAskedForAreRefusedWithoutReadingThem) {
  folder.write("a.json", "12345");
  EXPECT_TRUE(read(file, 5));
  EXPECT_THAT(read(file, 4).error().message, HasSubstr("got 5 bytes, wanted at most 4"));
  EXPECT_THAT(read("/dev/zero", 100).error().message, HasSubstr("got more than 100 bytes"));
  const fs::path huge = folder.path() / "huge";
  folder.write("huge", "");
  fs::resize_file(huge, std::uintmax_t{1} << 40);
  EXPECT_THAT(read(huge).error().message, HasSubstr("got 1099511627776 bytes"));
}

TEST_F(Files, NoFolderIsMade) {
  const fs::path below = folder.path() / "nowhere" / "a.json";
  const auto written = write(below, "x");
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().message, AllOf(HasSubstr(below.string()), HasSubstr("nowhere is not there")));
  EXPECT_TRUE(names().empty());
  EXPECT_FALSE(write(folder.path(), "x"));
}

TEST_F(Files, OutputsAreAllCheckedBeforeTheWorkAndAllNamed) {
  folder.write("b.txt", "");
  const std::vector<Output> outputs{{"--json", folder.path() / "no" / "x.json", {}},
                                    {"--picture", folder.path() / "x.jpg", {".png", ".gif"}},
                                    {"--plot", folder.path(), {".png"}},
                                    {"--output", folder.path() / "b.txt" / "x", {}},
                                    {"--more", "/proc/x.json", {}},
                                    {"--fine", folder.path() / "fine.PNG", {".png"}},
                                    {"--none", "", {".png"}},
                                    {"-o", "-", {".png"}}};
  const auto checked = check_outputs(outputs);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().code, Code::kInvalidArgument);
  const std::string& message = checked.error().message;
  EXPECT_THAT(message, AllOf(HasSubstr("--json: got '"), HasSubstr("/no is not there")));
  EXPECT_THAT(message, HasSubstr("x.jpg', wanted a name that ends in .png, .gif"));
  EXPECT_THAT(message, HasSubstr(", a folder, wanted a file"));
  EXPECT_THAT(message, HasSubstr("b.txt is not a folder"));
  EXPECT_THAT(message, HasSubstr("--more: got '/proc/x.json'"));
  EXPECT_THAT(message, AllOf(Not(HasSubstr("--fine")), Not(HasSubstr("--none")), Not(HasSubstr("-o: "))));
  EXPECT_EQ(std::ranges::count(message, '\n'), 4);
  EXPECT_EQ(names(), std::vector<std::string>{"b.txt"});  // nothing is left behind
}

TEST_F(Files, OutputsOfOneNameAreRefusedButForDevices) {
  EXPECT_THAT(check_outputs(std::vector<Output>{{"--a", file, {}}, {"--b", file, {}}}).error().message,
              HasSubstr("--b: got '" + file.string() + "' twice"));
  EXPECT_FALSE(check_outputs(std::vector<Output>{{"--a", "-", {}}, {"--b", "-", {}}}));
  EXPECT_TRUE(check_outputs(std::vector<Output>{{"--a", "/dev/null", {}}, {"--b", "/dev/null", {}}}));
}

TEST_F(Files, OutputsThatCannotBeWrittenAreTroubleOfTheEnvironment) {
  EXPECT_EQ(check_outputs(std::vector<Output>{{"--a", "/nowhere/x", {}}}).error().code, Code::kIo);
}

TEST_F(Files, FolderOfFilesHasToBeNewOrEmpty) {
  EXPECT_TRUE(check_output({"-o", folder.path() / "new", {}, true}));
  EXPECT_TRUE(check_output({"-o", folder.path() / "new" / "", {}, true}));
  EXPECT_TRUE(check_output({"-o", folder.path(), {}, true}));
  EXPECT_TRUE(names().empty());
  folder.write("a.json", "");
  EXPECT_THAT(check_output({"-o", folder.path(), {}, true}).error().message, HasSubstr("in which there is something"));
  EXPECT_THAT(check_output({"-o", file, {}, true}).error().message, HasSubstr("a file, wanted a folder"));
  EXPECT_EQ(check_output({"-o", folder.path() / "no" / "new", {}, true}).error().code, Code::kIo);
}

}  // namespace
}  // namespace jostle::files
