#include "services/common/process/exit_codes.hpp"

#include <gtest/gtest.h>

namespace jostle::common {
namespace {

TEST(ExitCodes, GoWithTheKindOfError) {
  EXPECT_EQ(exit_code_of({Code::kInvalidArgument, ""}), 2);
  EXPECT_EQ(exit_code_of({Code::kNotFound, ""}), 2);
  EXPECT_EQ(exit_code_of({Code::kUnknownWorld, ""}), 2);
  EXPECT_EQ(exit_code_of({Code::kIo, ""}), 3);
  EXPECT_EQ(exit_code_of({Code::kUnavailable, ""}), 3);
  EXPECT_EQ(exit_code_of({Code::kInternal, ""}), 3);
  EXPECT_EQ(exit_code_of({Code::kDeadline, ""}), 1);
  EXPECT_EQ(exit_code_of({Code::kCancelled, ""}), 130);
}

TEST(ExitCodes, AreOneSentenceInEveryHelp) {
  EXPECT_EQ(exit_codes_help(),
            "Exit codes: 0 done, 1 the task failed, 2 bad input or usage, 3 a part of the system failed, or an output "
            "cannot be written, 130 interrupted.");
  EXPECT_EQ(exit_codes_help("bit-equal", "not").substr(0, 31), "Exit codes: 0 bit-equal, 1 not,");
}

}  // namespace
}  // namespace jostle::common
