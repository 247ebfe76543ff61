#include "idl/types/bytes.hpp"

#include <gmock/gmock.h>

namespace jostle {
namespace {

using testing::ElementsAre;

TEST(ByteWriter, PutsNumbersInItsOrder) {
  EXPECT_THAT(BigEndianWriter().put(std::uint16_t{0x0102}).put(std::int32_t{-2}).take(),
              ElementsAre(1, 2, 0xFF, 0xFF, 0xFF, 0xFE));
  EXPECT_THAT(LittleEndianWriter().put(std::uint16_t{0x0102}).put(std::int32_t{-2}).take(),
              ElementsAre(2, 1, 0xFE, 0xFF, 0xFF, 0xFF));
  EXPECT_THAT(BigEndianWriter().put(1.0).take(), ElementsAre(0x3F, 0xF0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(BigEndianWriter().put("ab").put(true).take(), ElementsAre('a', 'b', 1));
}

template <class Writer, class Reader>
void expect_equal_there_and_back() {
  const Bytes bytes =
      Writer().put(0.1f).put(-1e300).put(std::uint64_t{1} << 40).put(std::array<std::int16_t, 2>{-3, 4}).take();
  Reader in(bytes);
  EXPECT_EQ(in.template get<float>(), 0.1f);
  EXPECT_EQ(in.template get<double>(), -1e300);
  EXPECT_EQ(in.template get<std::uint64_t>(), std::uint64_t{1} << 40);
  EXPECT_THAT((in.template get_array<std::int16_t, 2>()), ElementsAre(-3, 4));
  EXPECT_TRUE(in.done());
}

TEST(ByteReader, ReadsWhatWasWrittenInEitherOrder) {
  expect_equal_there_and_back<BigEndianWriter, BigEndianReader>();
  expect_equal_there_and_back<LittleEndianWriter, LittleEndianReader>();
}

// A truth value is 0 or not, whatever the byte is: 2 is no bool to copy.
TEST(ByteReader, TakesAnyByteForATruthValue) {
  const Bytes bytes{0, 1, 2};
  BigEndianReader in(bytes);
  EXPECT_FALSE(in.get<bool>());
  EXPECT_TRUE(in.get<bool>());
  EXPECT_TRUE(in.get<bool>());
}

TEST(ByteReader, SaysThatSomethingWasMissingAndGoesNoFurther) {
  const Bytes bytes{1, 2, 3};
  BigEndianReader in(bytes);
  EXPECT_EQ(in.get<std::uint16_t>(), 0x0102);
  EXPECT_EQ(in.get<std::uint32_t>(), 0u);
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(in.get<std::uint8_t>(), 0) << "the last byte is no start of anything";
  EXPECT_EQ(in.get_text(5), "");
  EXPECT_FALSE(in.done());
}

}  // namespace
}  // namespace jostle
