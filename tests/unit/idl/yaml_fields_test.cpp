#include "idl/text/yaml_fields.hpp"

#include <gmock/gmock.h>

#include <chrono>

namespace jostle::yaml {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Values {
  int whole = -1;
  unsigned count = 7;
  double number = -1.0;
  bool flag = false;
  std::string word = "none";
  std::vector<double> list;
};

Result<Values> parsed(const std::string& text) {
  return parse<Values>(text, "a.yaml", [](const YAML::Node& root) -> Result<Values> {
    Values values;
    Fields fields(root, "", "a.yaml");
    fields.optional("whole", values.whole);
    fields.optional("count", values.count);
    fields.optional("number", values.number);
    fields.optional("flag", values.flag);
    fields.optional("word", values.word);
    fields.optional("list", values.list);
    fields.finish();
    return values;
  });
}

std::string refusal(const std::string& text) {
  const auto result = parsed(text);
  return result ? "taken" : result.error().message;
}

TEST(YamlNumbers, AreDecimal) {
  EXPECT_EQ(parsed("whole: 050")->whole, 50);
  EXPECT_EQ(parsed("whole: +5")->whole, 5);
  EXPECT_EQ(parsed("whole: -007")->whole, -7);
  EXPECT_EQ(parsed("number: 050")->number, 50.0);
  EXPECT_EQ(parsed("number: .5")->number, 0.5);
  EXPECT_EQ(parsed("number: 5.")->number, 5.0);
  EXPECT_EQ(parsed("number: +1e3")->number, 1000.0);
  EXPECT_EQ(parsed("number: -1E-3")->number, -0.001);
  EXPECT_EQ(parsed("count: 010")->count, 10u);
  EXPECT_EQ(parsed("list: [010, 1e1, +.5]")->list, (std::vector<double>{10, 10, 0.5}));
  EXPECT_EQ(parsed("word: 050")->word, "050");
  EXPECT_EQ(parsed("word: yes")->word, "yes");
}

TEST(YamlNumbers, InOtherNotationsAreRefused) {
  for (const char* text : {"0x10", "0o17", "1_000", "1,000", "yes", "true", "on",     "12h",  "1e3",  "1.0",
                           "--5",  "+-5",  "+",     "~",     "",    "[1]",  "{a: 1}", "'5 '", "1:30", "½"}) {
    EXPECT_THAT(refusal(std::string("whole: ") + text), HasSubstr("a.yaml:1: whole: got ")) << text;
    EXPECT_THAT(refusal(std::string("whole: ") + text), HasSubstr("wanted a whole number")) << text;
  }
  for (const char* text : {"0x10", "0x1p3", "1_000", ".inf", "-.inf", ".nan", "inf", "nan", "infinity", "1e999", "yes",
                           "false", "e3", ".", "1.2.3", "~", "[1.0]"}) {
    EXPECT_THAT(refusal(std::string("number: ") + text),
                AllOf(HasSubstr("a.yaml:1: number: got "), HasSubstr(" number")))
        << text;
    EXPECT_THAT(refusal(std::string("list: [1, ") + text + "]"), Not(HasSubstr("taken"))) << text;
  }
}

TEST(YamlNumbers, ThatAreNotFiniteAreToldSo) {
  for (const char* text : {".inf", "-.INF", ".nan", "inf", "1e999", "-1e999"})
    EXPECT_THAT(refusal(std::string("number: ") + text), HasSubstr("wanted a finite number")) << text;
}

TEST(YamlNumbers, BeyondTheirTypeAreRefusedWithItsRange) {
  EXPECT_THAT(refusal("whole: 3000000000"),
              HasSubstr("got '3000000000', wanted a whole number, -2147483648 to 2147483647"));
  EXPECT_THAT(refusal("count: 5000000000"), HasSubstr("0 to 4294967295"));
  EXPECT_THAT(refusal("count: -1"), HasSubstr("wanted a whole number, 0"));
}

TEST(YamlYesOrNo, IsNoNumber) {
  EXPECT_TRUE(parsed("flag: yes")->flag);
  EXPECT_TRUE(parsed("flag: True")->flag);
  EXPECT_FALSE(parsed("flag: off")->flag);
  for (const char* text : {"1", "0", "y", "maybe", "[true]", "~"})
    EXPECT_THAT(refusal(std::string("flag: ") + text), HasSubstr("wanted true or false")) << text;
}

TEST(YamlTexts, AreWords) {
  for (const char* text : {"[a]", "{a: 1}", "~", ""})
    EXPECT_THAT(refusal(std::string("word: ") + text), HasSubstr("wanted text")) << text;
}

TEST(YamlComplaints, AreToldAllAtOnceByLine) {
  const std::string message = refusal("number: x\nwhole: y\nwrod: z\nflag: 3\nlist: [1, b, c]\nflag: true\n");
  EXPECT_EQ(message,
            "a.yaml:1: number: got 'x', wanted a number\n"
            "a.yaml:2: whole: got 'y', wanted a whole number\n"
            "a.yaml:3: wrod: unknown key wrod, did you mean word?\n"
            "a.yaml:4: flag: got '3', wanted true or false\n"
            "a.yaml:5: list[1]: got 'b', wanted a number\n"
            "a.yaml:5: list[2]: got 'c', wanted a number\n"
            "a.yaml:6: flag: given twice, wanted once");
}

TEST(YamlComplaints, OfMisspeltKeysStandForWhatTheyLeaveOut) {
  const auto result = parse<int>("- x\n", "a.yaml", [](const YAML::Node&) -> Result<int> {
    const YAML::Node root = YAML::Load("list: [{frictoin: 1, nothing_like_it: 2}, {}]");
    Fields fields(root, "", "a.yaml");
    double friction = 0.0;
    fields.list("list", [&](Fields& in) { in.required("friction", friction); });
    fields.finish();
    return 1;
  });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message,
            "a.yaml:1: list[0].frictoin: unknown key frictoin, did you mean friction?\n"
            "a.yaml:1: list[0].nothing_like_it: unknown key, wanted one of: friction\n"
            "a.yaml:1: list[1].friction: missing, wanted a number");
}

TEST(YamlComplaints, OfARefusedMappingLetTheOthersBeRead) {
  const auto result = parse<int>("a: {x: 1}\nb: {x: z}\n", "a.yaml", [](const YAML::Node& root) -> Result<int> {
    Fields fields(root, "", "a.yaml");
    for (const char* key : {"a", "b"}) {
      fields.section(key, true, [&](Fields& in) {
        int x = 0;
        in.optional("x", x);
        if (x == 1) in.refuse("x", "got 1, wanted 2");
      });
    }
    fields.finish();
    return 1;
  });
  EXPECT_EQ(result.error().message, "a.yaml:1: a.x: got 1, wanted 2\na.yaml:2: b.x: got 'z', wanted a whole number");
}

TEST(YamlComplaints, BeyondTwentyAreCounted) {
  std::string text = "list: [";
  for (int i = 0; i < 30; ++i) text += "x, ";
  EXPECT_THAT(refusal(text + "]"), HasSubstr("\na.yaml: and 10 more"));
}

TEST(YamlTree, TabsAreExplained) {
  EXPECT_THAT(refusal("flag: true\nlist:\n\t- 1\n"),
              HasSubstr("a.yaml:3: got a tab in the indentation, wanted blanks"));
}

TEST(YamlTree, ThatIsLargeDeepOrEndlessIsRefusedAtOnce) {
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(refusal(std::string(2 << 20, ' ')), HasSubstr("got 2097152 bytes, wanted at most 1048576"));
  for (const char* part : {"[", "{", "- ", "{a: "}) {
    std::string text;
    for (int i = 0; i < 100'000; ++i) text += part;
    EXPECT_NE(refusal(text), "taken") << part;
  }
  std::string lists("list: ");
  lists.append(100, '[').append(100, ']');
  EXPECT_THAT(refusal(lists), HasSubstr("64 deep"));
  EXPECT_THAT(refusal("list: &a [*a]\n"), HasSubstr("deep"));
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) laughs += (k ? ", *a" : "*a") + std::to_string(i - 1);
    laughs += "]\n";
  }
  EXPECT_THAT(refusal(laughs), HasSubstr("more than 1000000 values"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
}

TEST(YamlTree, IsUtf8) {
  EXPECT_EQ(parsed("word: \"Dose, \xc3\xbc, \xe2\x82\xac, \xf0\x9f\xa4\x96\"")->word,
            "Dose, \xc3\xbc, \xe2\x82\xac, \xf0\x9f\xa4\x96");
  for (const char* bytes :
       {"\xff", "\xc3", "\xc3(", "\xc0\x80", "\xe0\x80\x80", "\xed\xa0\x80", "\xf5\x80\x80\x80", "\xe2\x82"})
    EXPECT_THAT(refusal(std::string("flag: true\nword: ") + bytes), HasSubstr("a.yaml:2: got bytes that are no UTF-8"));
}

TEST(YamlTree, OfSeveralDocumentsIsRefused) {
  EXPECT_THAT(refusal("flag: true\n---\nflag: false\n"), HasSubstr("got 2 YAML documents, wanted one"));
  EXPECT_TRUE(parsed("--- \nflag: true\n"));
}

TEST(YamlTree, OfNothingIsRefused) {
  for (const char* text : {"", "# nothing\n", "~", "5", "[1]"})
    EXPECT_THAT(refusal(text), HasSubstr("wanted a mapping of keys to values")) << text;
}

}  // namespace
}  // namespace jostle::yaml
