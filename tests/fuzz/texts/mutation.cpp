#include "tests/fuzz/texts/mutation.hpp"

#include <algorithm>
#include <functional>
#include <string_view>

namespace jostle::tests {
namespace {

std::string repeated(std::string_view part, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += part;
  return text;
}

const std::vector<std::string>& nasty_values() {
  static const std::vector<std::string> values{"",
                                               "0",
                                               "-0",
                                               "-1",
                                               "1",
                                               "050",
                                               "0x10",
                                               "0o17",
                                               "1_000",
                                               "+5",
                                               ".5",
                                               "5.",
                                               "1e3",
                                               "1e-300",
                                               "1e999",
                                               "-1e999",
                                               "2147483648",
                                               "-2147483649",
                                               "18446744073709551616",
                                               ".nan",
                                               ".inf",
                                               "-.inf",
                                               "nan",
                                               "inf",
                                               "NaN",
                                               "true",
                                               "yes",
                                               "no",
                                               "null",
                                               "~",
                                               "''",
                                               "\"\"",
                                               "\"\\x00\"",
                                               "\"\\UFFFFFFFF\"",
                                               "\"\\ud800\"",
                                               "[]",
                                               "{}",
                                               "[[]]",
                                               "{a: {a: {}}}",
                                               "[1, 2, 3]",
                                               "*a",
                                               "&a [*a]",
                                               "&a b",
                                               "!!binary x",
                                               "!tag x",
                                               "|",
                                               ">-",
                                               "- x",
                                               "? x",
                                               ": ",
                                               "@",
                                               "%",
                                               "`",
                                               "<<: x",
                                               "\xff\xfe",
                                               "\xc3\x28",
                                               "ü",
                                               std::string(1, '\0'),
                                               std::string(3000, '9'),
                                               "0." + std::string(3000, '1'),
                                               std::string(70'000, 'x'),
                                               repeated("[", 3000),
                                               repeated("{a: ", 3000),
                                               repeated("- ", 3000),
                                               repeated("<a>", 3000),
                                               "&lt;",
                                               "&#0;",
                                               "&#xFFFFFF;",
                                               "<![CDATA[x]]>",
                                               "<!-- -->",
                                               "<?x?>",
                                               "%s%n",
                                               "../../../etc/passwd",
                                               "/dev/zero"};
  return values;
}

std::size_t any_place(const std::string& text, Dice& dice) { return dice.below(text.size() + 1); }

// --- bytes ------------------------------------------------------------------------

void change_byte(std::string& text, Dice& dice) {
  if (!text.empty()) text[dice.below(text.size())] = static_cast<char>(dice.below(256));
}

// The mildest change: most texts stay what they are, with another number.
void change_digit(std::string& text, Dice& dice) {
  const std::size_t at = text.find_first_of("0123456789", any_place(text, dice));
  if (at != text.npos) text[at] = static_cast<char>('0' + dice.below(10));
}

void flip_bit(std::string& text, Dice& dice) {
  if (text.empty()) return;
  char& byte = text[dice.below(text.size())];
  byte = static_cast<char>(static_cast<unsigned char>(byte) ^ (1u << dice.below(8)));
}

void cut_out(std::string& text, Dice& dice) {
  const std::size_t at = any_place(text, dice);
  text.erase(at, dice.below(dice.one_in(2) ? 8 : text.size() + 1));
}

void cut_off(std::string& text, Dice& dice) { text.resize(any_place(text, dice)); }

void repeat_part(std::string& text, Dice& dice) {
  const std::size_t at = any_place(text, dice);
  const std::string part = text.substr(at, dice.below(200));
  text.insert(at, repeated(part, 1 + dice.below(20)));
}

void insert_noise(std::string& text, Dice& dice) {
  std::string noise(1 + dice.below(16), ' ');
  for (char& byte : noise) byte = static_cast<char>(dice.below(256));
  text.insert(any_place(text, dice), noise);
}

void splice(std::string& text, const std::vector<std::string>& others, Dice& dice) {
  const std::string& other = dice.one_of(others);
  text = text.substr(0, any_place(text, dice)) + other.substr(any_place(other, dice));
}

// --- lines and values -----------------------------------------------------------------

struct Part {
  std::size_t begin = 0, size = 0;
};

std::vector<Part> lines_of(const std::string& text) {
  std::vector<Part> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size() - 1) + 1;
    lines.push_back({begin, end - begin});
    begin = end;
  }
  return lines;
}

void change_lines(std::string& text, Dice& dice) {
  const std::vector<Part> lines = lines_of(text);
  if (lines.empty()) return;
  const Part line = dice.one_of(lines), other = dice.one_of(lines);
  const std::string content = text.substr(other.begin, other.size);
  switch (dice.below(5)) {
    case 0:
      text.erase(line.begin, line.size);
      break;
    case 1:
      text.insert(line.begin, content);
      break;
    case 2:
      text.replace(line.begin, line.size, content);
      break;
    case 3:
      text.insert(line.begin, dice.one_in(2) ? "\t" : "  ");
      break;
    default:
      text.insert(line.begin, dice.one_of(nasty_values()) + "\n");
  }
}

// What stands between a delimiter and one of those that end it.
std::vector<Part> values_between(const std::string& text, std::string_view begins, std::string_view ends) {
  std::vector<Part> values;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (begins.find(text[i]) == begins.npos) continue;
    std::size_t begin = i + 1;
    while (begin < text.size() && text[begin] == ' ') ++begin;
    const std::size_t end = std::min(text.find_first_of(ends, begin), text.size());
    if (end > begin) values.push_back({begin, end - begin});
  }
  return values;
}

void change_value(std::string& text, std::string_view begins, std::string_view ends, Dice& dice) {
  const std::vector<Part> values = values_between(text, begins, ends);
  if (values.empty()) return;
  const Part value = dice.one_of(values), other = dice.one_of(values);
  const std::string content = dice.one_in(4) ? text.substr(other.begin, other.size) : dice.one_of(nasty_values());
  text.replace(value.begin, value.size, content);
}

// "<a>…</a>" twice, without one of its ends, or inside out.
void change_element(std::string& text, Dice& dice) {
  const std::vector<Part> tags = values_between(text, "<", ">");
  if (tags.empty()) return;
  const Part tag = dice.one_of(tags), other = dice.one_of(tags);
  const std::string name = text.substr(other.begin, other.size);
  switch (dice.below(4)) {
    case 0:
      text.erase(tag.begin - 1, std::min(tag.size + 2, text.size() - tag.begin + 1));
      break;
    case 1:
      text.replace(tag.begin, tag.size, name);
      break;
    case 2:
      text.insert(tag.begin - 1, repeated("<" + name + ">", 1 + dice.below(600)));
      break;
    default:
      text.insert(tag.begin - 1, text.substr(tag.begin - 1, dice.below(2000)));
  }
}

}  // namespace

std::string mutated(std::string text, Grammar grammar, const std::vector<std::string>& others, Dice& dice) {
  using Change = std::function<void(std::string&)>;
  const auto with = [&dice](void (*change)(std::string&, Dice&)) {
    return Change([change, &dice](std::string& changed) { change(changed, dice); });
  };
  std::vector<Change> changes{with(change_byte),
                              with(flip_bit),
                              with(cut_out),
                              with(cut_off),
                              with(repeat_part),
                              with(insert_noise),
                              [&](std::string& s) { splice(s, others, dice); }};
  if (grammar != Grammar::kBytes && !dice.one_in(3)) {
    changes = {with(change_lines)};
    if (grammar == Grammar::kYaml)
      changes.resize(5, [&](std::string& s) { change_value(s, ":[,{", "\n,]}#", dice); });
    else
      changes.resize(3, [&](std::string& s) { change_value(s, ">\"", "<\"", dice); });
    if (grammar == Grammar::kXml) changes.push_back(with(change_element));
  }
  changes.push_back(with(change_digit));
  for (std::size_t i = dice.one_in(2) ? 1 : 1 + dice.below(4); i > 0; --i) dice.one_of(changes)(text);
  return text;
}

}  // namespace jostle::tests
