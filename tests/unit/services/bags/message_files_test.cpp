// Definitions of users' own types from .msg files.

#include <gmock/gmock.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "services/bags/format/definitions.hpp"
#include "services/bags/format/message_files.hpp"
#include "tests/support/rover.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using bags::MessageFiles;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// AMENT_PREFIX_PATH as a test wants it, and as it was at its end.
class Installed {
 public:
  explicit Installed(const std::string& folders) {
    if (const char* before = std::getenv(kName)) before_ = before;
    setenv(kName, folders.c_str(), 1);
  }
  ~Installed() { setenv(kName, before_.c_str(), 1); }

 private:
  static constexpr const char* kName = "AMENT_PREFIX_PATH";
  std::string before_;
};

class MessageFilesTest : public ::testing::Test {
 protected:
  // Writes pkg/msg/Name.msg below a folder.
  void write(const std::string& below, const std::string& package, const std::string& name, const std::string& text) {
    const fs::path place = fs::path(folder.path()) / below / package / "msg";
    fs::create_directories(place);
    folder.write((place / (name + ".msg")).lexically_relative(folder.path()), text);
  }
  std::string at(const std::string& below) const { return (fs::path(folder.path()) / below).string(); }

  const TempFolder folder;
  const Installed none{""};
};

TEST_F(MessageFilesTest, FindATypeWithAllThatItIsMadeOf) {
  const auto definition = MessageFiles({kMessageFolder}).definition(kWheelType);

  ASSERT_TRUE(definition) << definition.error().message;
  EXPECT_THAT(*definition, StartsWith("# How a wheel of a rover turns"));
  EXPECT_THAT(*definition, AllOf(HasSubstr("\nMSG: std_msgs/Header\n"), HasSubstr("\nMSG: builtin_interfaces/Time\n"),
                                 HasSubstr("\nMSG: rover_msgs/Tread\nfloat32 wear")));
  const auto decoder = bags::Decoder::create(kWheelType, *definition);
  ASSERT_TRUE(decoder) << decoder.error().message;
  EXPECT_EQ(decoder->decode(wheel()).value().dump(),
            R"({"header":{"stamp":{"sec":5,"nanosec":6},"frame_id":"a"},"speed":1.5,)"
            R"("treads":[{"wear":0.25,"codes":[7,8]}]})");
}

TEST_F(MessageFilesTest, LookIntoWorkspacesInstalledFoldersAndPackages) {
  write("install/share", "a_msgs", "One", "int32 x\n");
  write("packages", "b_msgs", "Two", "a_msgs/One[<=3] ones\n");

  EXPECT_TRUE(MessageFiles({at("install")}).definition("a_msgs/msg/One"));
  EXPECT_TRUE(MessageFiles({at("packages"), at("install")}).definition("b_msgs/msg/Two"));
  EXPECT_TRUE(MessageFiles({at("packages/b_msgs/"), at("install")}).definition("b_msgs/msg/Two"));
  const Installed installed(at("packages") + "::" + at("install"));
  EXPECT_TRUE(MessageFiles().definition("b_msgs/msg/Two"));
}

TEST_F(MessageFilesTest, PreferTheUsersOverOursAndOursOverInstalledOnes) {
  write("user", "std_msgs", "Bool", "bool users\n");
  write("ros/share", "std_msgs", "Bool", "bool installed\n");
  const Installed installed(at("ros"));

  EXPECT_EQ(MessageFiles({at("user")}).definition("std_msgs/msg/Bool").value(), "bool users\n");
  EXPECT_EQ(MessageFiles().definition("std_msgs/msg/Bool").value(), "bool data\n");
}

TEST_F(MessageFilesTest, SayWhatIsMissingAndWhereItWasLookedFor) {
  write("user", "a_msgs", "Whole", "Part part\n");

  const auto missing = MessageFiles({at("user")}).definition("a_msgs/msg/Whole");

  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, Code::kNotFound);
  EXPECT_THAT(missing.error().message, AllOf(HasSubstr("a_msgs/msg/Part"), HasSubstr(at("user")),
                                             HasSubstr("--messages"), HasSubstr("AMENT_PREFIX_PATH")));
  EXPECT_THAT(bags::message_files({at("nowhere")}).error().message, HasSubstr("--messages: got " + at("nowhere")));
}

TEST_F(MessageFilesTest, RefuseWhatIsMalformedOrEndless) {
  write("user", "a_msgs", "Bad", "int32 x\nint32[ y\n");
  write("user", "a_msgs", "Endless", "Other other\n");
  write("user", "a_msgs", "Other", "Endless[] more\n");
  const MessageFiles sut({at("user")});

  EXPECT_THAT(sut.definition("a_msgs/msg/Bad").error().message, HasSubstr("line 2"));
  EXPECT_EQ(sut.definition("a_msgs/msg/Endless").error().code, Code::kInvalidArgument);
  EXPECT_THAT(sut.definition("a_msgs/msg/Endless").error().message, HasSubstr("contains itself"));
}

// Types come from the wire, and files that they name from a disk.
TEST_F(MessageFilesTest, OpenNoFileOutsideOfTheirFolders) {
  folder.write("secret.msg", "int32 x\n");
  fs::create_directories(fs::path(folder.path()) / "user" / "a_msgs" / "msg");
  const MessageFiles sut({at("user")});

  for (const char* type : {"../msg/secret", "a_msgs/msg/../../../secret", "/msg/secret", "a_msgs/srv/Add", ""})
    EXPECT_EQ(sut.definition(type).error().code, Code::kNotFound) << type;
  write("user", "a_msgs", "Climber", "../../../secret s\n");
  EXPECT_EQ(sut.definition("a_msgs/msg/Climber").error().code, Code::kNotFound);
}

}  // namespace
}  // namespace jostle::tests
