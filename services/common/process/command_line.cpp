#include "services/common/process/command_line.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <optional>
#include <regex>
#include <sstream>

#include "idl/text/nearest.hpp"
#include "idl/types/number.hpp"
#include "services/common/process/exit_codes.hpp"
#include "services/common/process/program.hpp"

namespace jostle::common {
namespace {

using Words = std::vector<std::string>;
using Options = std::vector<const CLI::Option*>;

// --- reading CLI11's objects --------------------------------------------------

constexpr const char* kSuggestions = "suggestions";

Words split(const std::string& text, char separator) {
  Words parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

// They hang on the option as a check that is switched off, whose description lists them.
std::optional<Words> suggestions(const CLI::Option& option) {
  try {
    // CLI11 looks for checks in options that may change only.
    CLI::Validator check = *const_cast<CLI::Option&>(option).get_validator(kSuggestions);
    return split(check.active().get_description(), '\n');
  } catch (const CLI::OptionNotFound&) {
    return {};
  }
}

// Those of an unnamed group are the command's own.
Options options_of(const CLI::App& app) {
  Options options;
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) options.push_back(option);
  }
  for (const CLI::App* group : app.get_subcommands([](const CLI::App* sub) { return sub->get_name().empty(); })) {
    const Options more = options_of(*group);
    options.insert(options.end(), more.begin(), more.end());
  }
  return options;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* sub) { return !sub->get_name().empty(); });
}

const CLI::App* find_command(const CLI::App& app, const std::string& name) {
  const auto commands = commands_of(app);
  const auto found = std::ranges::find(commands, name, [](const CLI::App* one) { return one->get_name(); });
  return found == commands.end() ? nullptr : *found;
}

Words names_of(const std::vector<const CLI::App*>& commands) {
  Words names;
  for (const CLI::App* command : commands) names.push_back(command->get_name());
  return names;
}

// The command that the parser came to.
const CLI::App& reached(const CLI::App& app) {
  for (const CLI::App* sub : app.get_subcommands()) {
    if (!sub->get_name().empty()) return reached(*sub);
  }
  return app;
}

std::string full_name(const CLI::App& app) {
  return app.get_parent() ? fmt::format("{} {}", full_name(*app.get_parent()), app.get_name()) : app.get_name();
}

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

// "{dds,threads}" is how a check lists its values.
Words values_of(const CLI::Option& option) {
  if (const auto given = suggestions(option)) return *given;
  static const std::regex kSet("\\{([^{}]*)\\}");
  const std::string type = option.get_type_name();
  std::smatch set;
  if (!std::regex_search(type, set, kSet)) return {};
  return split(set.str(1), ',');
}

bool is_text(const CLI::Option& option) { return option.get_type_name().starts_with("TEXT"); }

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

// --- mistakes -----------------------------------------------------------------

std::string meant_option(const CLI::App& app, const std::string& word) {
  Words known;  // without dashes, which all have in common
  for (const CLI::Option* option : options_of(app)) {
    known.insert(known.end(), option->get_lnames().begin(), option->get_lnames().end());
  }
  const std::string meant = nearest(word.substr(word.find_first_not_of('-')), known);
  return meant.empty() ? "" : fmt::format("; did you mean --{}?", meant);
}

std::string unknown_command(const CLI::App& app, const std::string& word) {
  const Words commands = names_of(commands_of(app));
  if (commands.empty()) return fmt::format("got subcommand '{}', wanted none: there are none", word);
  return fmt::format("unknown subcommand '{}', wanted {}{}", word, fmt::join(commands, ", "),
                     did_you_mean(word, commands));
}

// What the parser could not place; nothing if it placed everything.
std::optional<std::string> unknown_word(const CLI::App& app, bool ends_here) {
  const Words left = app.remaining();
  const auto option = std::ranges::find_if(left, [](const std::string& word) {
    return word.size() > 1 && word.front() == '-' && word.find_first_not_of('-') != std::string::npos;
  });
  if (option != left.end()) {
    const std::string name = option->substr(0, option->find('='));
    return fmt::format("unknown option {}{}", name, meant_option(app, name));
  }
  if (left.empty() || !ends_here) return {};
  if (commands_of(app).empty()) return fmt::format("got '{}', wanted nothing more", left.front());
  return unknown_command(app, left.front());
}

// "1024", not "1024.000000".
std::string number(const std::string& text) { return fmt::format("{:g}", std::strtod(text.c_str(), nullptr)); }

// CLI11's own sentences, as ours: OPTION: got GOT, wanted WANTED.
std::string reworded(const CLI::App& app, const std::string& message) {
  static const std::regex kRange("(.*): Value (.*) not in range (.*) to (.*)");
  static const std::regex kSet("(.*): (.*) not in \\{(.*)\\}");
  static const std::regex kKind("Could not convert: (.*) = (.*)");
  static const std::regex kFew("(.*): ([0-9]+) required (.*) missing");
  static const std::regex kRequired("(.*) is required");
  static const std::regex kExcluded("(.*) excludes (.*)");
  constexpr double kAnyNumber = 1e300;  // a limit that is none
  std::smatch part;
  if (message == "A subcommand is required")
    return fmt::format("got no subcommand, wanted {}", fmt::join(names_of(commands_of(app)), ", "));
  if (std::regex_match(message, part, kRange)) {
    const bool is_open = std::strtod(part.str(4).c_str(), nullptr) > kAnyNumber;
    return fmt::format("{}: got '{}', wanted {}", part.str(1), part.str(2),
                       is_open ? "a number above " + number(part.str(3))
                               : fmt::format("{} to {}", number(part.str(3)), number(part.str(4))));
  }
  if (std::regex_match(message, part, kSet)) {
    const Words values = split(part.str(3), ',');
    return fmt::format("{}: got '{}', wanted {}{}", part.str(1), part.str(2), fmt::join(values, ", "),
                       did_you_mean(part.str(2), values));
  }
  if (std::regex_match(message, part, kKind)) {
    const auto* option = app.get_option_no_throw(part.str(1));
    const std::string type = option ? option->get_type_name() : "";
    return fmt::format("{}: got '{}', wanted {}", part.str(1), part.str(2),
                       type.starts_with("FLOAT")  ? "a number"
                       : type.starts_with("UINT") ? "a whole number that is not negative"
                                                  : "a whole number");
  }
  if (std::regex_match(message, part, kFew))
    return fmt::format("{}: got no value, wanted {}", part.str(1), part.str(3));
  if (std::regex_match(message, part, kRequired)) return fmt::format("got no {}, wanted one", part.str(1));
  if (std::regex_match(message, part, kExcluded))
    return fmt::format("{}: got {} as well, wanted one of the two", part.str(1), part.str(2));
  return message;
}

// --- completion ---------------------------------------------------------------

std::string with_meaning(const std::string& word, const std::string& meaning) {
  return meaning.empty() ? word : fmt::format("{}\t{}", word, first_line(meaning));
}

void add_options(const CLI::App& app, Words& lines) {
  for (const CLI::Option* option : options_of(app)) {
    for (const std::string& name : option->get_lnames())
      lines.push_back(with_meaning("--" + name, option->get_description()));
  }
}

void add_values(const CLI::Option& option, Words& lines) {
  const Words values = values_of(option);
  lines.insert(lines.end(), values.begin(), values.end());
  if (values.empty() && is_text(option) && !suggestions(option)) lines.emplace_back(":files");
}

const CLI::Option* find_option(const CLI::App& app, const std::string& word) {
  for (const CLI::Option* option : options_of(app)) {
    if (word.starts_with("--") ? option->check_lname(word.substr(2))
                               : word.size() == 2 && word[0] == '-' && option->check_sname(word.substr(1)))
      return option;
  }
  return nullptr;
}

// How far a command line has come before its last word.
struct Place {
  const CLI::App* app;
  const CLI::Option* option = nullptr;  // whose value is next
  int positionals = 0;                  // that were given
};

Place place_after(const CLI::App& app, const Words& words) {
  Place place{.app = &app};
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (std::exchange(place.option, nullptr)) continue;
    const std::string& word = words[i];
    if (word.size() > 1 && word.front() == '-') {
      const auto* option = find_option(*place.app, word);
      if (option && takes_value(*option)) place.option = option;
    } else if (const auto* command = find_command(*place.app, word)) {
      place = {.app = command};
    } else {
      ++place.positionals;
    }
  }
  return place;
}

const CLI::Option* next_positional(const CLI::App& app, int given) {
  for (const CLI::Option* option : options_of(app)) {
    if (!option->get_positional()) continue;
    const int most = option->get_items_expected_max();
    if (given < most) return option;
    given -= most;
  }
  return nullptr;
}

// --- manual pages -------------------------------------------------------------

// A character beyond ASCII, whose UTF-8 begins at `at`, as roff names it; `at` goes to its last byte.
std::string roff_name(const std::string& text, std::size_t& at) {
  const auto first = static_cast<unsigned char>(text[at]);
  const int more = first >= 0xF0 ? 3 : first >= 0xE0 ? 2 : 1;
  std::uint32_t code = first & (0x3Fu >> more);
  for (int i = 0; i < more && at + 1 < text.size(); ++i)
    code = code << 6 | (static_cast<unsigned char>(text[++at]) & 0x3Fu);
  return fmt::format("\\[u{:04X}]", code);
}

// A line of text, in which nothing is a macro.
std::string plain(const std::string& text) {
  std::string escaped;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (static_cast<unsigned char>(c) >= 0xC0) {
      escaped += roff_name(text, i);
    } else {
      escaped += c;
    }
  }
  return escaped.starts_with('.') || escaped.starts_with('\'') ? "\\&" + escaped : escaped;
}

std::string paragraph(const std::string& text) {
  std::string lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);)
    lines += plain(line.substr(std::min(line.find_first_not_of(' '), line.size()))) + "\n";
  return lines;
}

// "TEXT:{dds,threads}" as "dds|threads"; "INT in [1 - 9]" as it is.
std::string value_name(const CLI::Option& option) {
  const Words values = values_of(option);
  if (!values.empty() && !suggestions(option)) return fmt::format("{}", fmt::join(values, "|"));
  return option.get_type_name();
}

std::string option_entry(const CLI::Option& option) {
  Words names;
  if (option.get_positional()) names.push_back(fmt::format("\\fI{}\\fR", plain(option.get_single_name())));
  for (const std::string& name : option.get_snames()) names.push_back(fmt::format("\\fB\\-{}\\fR", plain(name)));
  for (const std::string& name : option.get_lnames()) names.push_back(fmt::format("\\fB\\-\\-{}\\fR", plain(name)));
  std::string entry = fmt::format(".TP\n{}", fmt::join(names, ", "));
  if (takes_value(option) && !option.get_positional()) entry += fmt::format(" \\fI{}\\fR", plain(value_name(option)));
  const std::string& meaning = option.get_description();
  entry += "\n" + paragraph(meaning + (meaning.empty() || meaning.ends_with('.') ? "" : "."));
  if (!option.get_default_str().empty()) entry += fmt::format("Default: {}.\n", plain(option.get_default_str()));
  return entry;
}

std::string synopsis(const CLI::App& app) {
  std::string text = fmt::format(".B {}\n", plain(full_name(app)));
  Words parts;
  if (!commands_of(app).empty()) parts.emplace_back("\\fISUBCOMMAND\\fR");
  parts.emplace_back("[\\fIOPTIONS\\fR]");
  for (const CLI::Option* option : options_of(app)) {
    if (!option->get_positional()) continue;
    const std::string name = fmt::format("\\fI{}\\fR", plain(option->get_single_name()));
    const std::string several = option->get_items_expected_max() > 1 ? " ..." : "";
    parts.push_back(option->get_required() ? name + several : fmt::format("[{}{}]", name, several));
  }
  return text + fmt::format("{}\n", fmt::join(parts, " "));
}

std::string option_entries(const CLI::App& app) {
  std::string positional, named;
  for (const CLI::Option* option : options_of(app)) {
    (option->get_positional() ? positional : named) += option_entry(*option);
  }
  return positional + named;
}

// A footer has examples, which are kept as they are, and the exit codes, which have a section of their own.
struct Footer {
  std::string text, codes;
};

Footer split_footer(const std::string& footer) {
  constexpr const char* kCodes = "Exit codes:";
  const std::size_t at = footer.find(kCodes);
  if (at == std::string::npos) return {.text = footer, .codes = ""};
  return {.text = footer.substr(0, at), .codes = footer.substr(at + std::string(kCodes).size())};
}

std::string verbatim(const std::string& text) {
  std::string lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines += plain(line) + "\n";
  return lines;
}

}  // namespace

CLI::Option* add_seed_option(CLI::App& app, const std::string& name, std::uint64_t& seed, const std::string& help) {
  const CLI::Validator whole(
      [](std::string& text) {
        std::uint64_t value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (error == std::errc() && end == text.data() + text.size()) return std::string();
        return fmt::format("got '{}', wanted a whole number from 0 to {}", text, UINT64_MAX);
      },
      "");
  return app.add_option(name, seed, help)->capture_default_str()->check(whole);
}

CLI::Validator port(int least) {
  return {[least](std::string& text) {
            constexpr int kMost = 65535;
            if (text.empty() || parse_whole(text, least, kMost)) return std::string();
            return fmt::format("got '{}', wanted a port, {} to {}", text, least, kMost);
          },
          ""};
}

void suggest(CLI::Option* option, const std::vector<std::string>& values) {
  const auto anything = [](std::string&) { return std::string(); };
  CLI::Validator check(anything, fmt::format("{}", fmt::join(values, "\n")), kSuggestions);
  option->check(check.active(false));
}

std::string explain(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& place = reached(app);
  const bool wants_more = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr ||
                          std::string(error.what()) == "A subcommand is required";
  const auto unknown = unknown_word(place, wants_more);
  const std::string what = unknown ? *unknown : reworded(place, first_line(error.what()));
  const bool says_what_instead = what.find("; did you mean") != std::string::npos;
  return fmt::format("{}: {}{}", full_name(app), what,
                     says_what_instead ? "" : fmt::format("; `{} --help` says more", full_name(place)));
}

Result<std::string> help_of(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* place = &app;
  for (const std::string& word : words) {
    const auto* command = find_command(*place, word);
    if (!command)
      return Error{Code::kNotFound, fmt::format("{}: {}", full_name(*place), unknown_command(*place, word))};
    place = command;
  }
  return place->help(place == &app ? "" : full_name(*place->get_parent()));
}

std::vector<std::string> completions(const CLI::App& app, const std::vector<std::string>& words) {
  Words lines;
  if (words.empty()) return lines;
  const Place place = place_after(app, words);
  const bool dashed = words.back().starts_with('-');
  const auto commands = commands_of(*place.app);
  const CLI::Option* valued = place.option;
  if (!valued && !dashed && commands.empty()) valued = next_positional(*place.app, place.positionals);
  if (valued) {
    add_values(*valued, lines);
  } else if (dashed || commands.empty()) {
    add_options(*place.app, lines);
  } else {
    for (const CLI::App* command : commands)
      lines.push_back(with_meaning(command->get_name(), command->get_description()));
  }
  return lines;
}

std::string manual_page(const CLI::App& app, const std::string& purpose) {
  std::string name = full_name(app);
  std::ranges::replace(name, ' ', '-');
  std::string title = name;
  std::ranges::transform(title, title.begin(), [](unsigned char c) { return std::toupper(c); });
  std::string page = fmt::format(".TH {} 1 \"\" \"Jostle {}\" \"User Commands\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n{}",
                                 title, JOSTLE_VERSION, plain(name), plain(purpose), synopsis(app));
  page += ".SH DESCRIPTION\n" + paragraph(app.get_description());
  page += ".SH OPTIONS\n" + option_entries(app);
  if (const auto commands = commands_of(app); !commands.empty()) {
    page += ".SH SUBCOMMANDS\n";
    for (const CLI::App* command : commands) {
      page += fmt::format(".SS {}\n{}.PP\n{}{}", plain(command->get_name()), paragraph(command->get_description()),
                          synopsis(*command), option_entries(*command));
    }
  }
  const Footer footer = split_footer(app.get_footer());
  if (!footer.text.empty()) page += ".SH NOTES\n.nf\n" + verbatim(footer.text) + ".fi\n";
  if (!footer.codes.empty()) page += ".SH EXIT STATUS\n" + paragraph(footer.codes);
  page += ".SH SEE ALSO\n.BR jostle (1),\nwhich says what variables of the environment mean; /usr/share/doc/jostle\n";
  return page;
}

void document_exit_codes(CLI::App& app) {
  const std::string footer = app.get_footer();
  if (footer.find("Exit codes:") != std::string::npos) return;
  app.footer(footer + (footer.empty() ? "" : "\n") + exit_codes_help());
}

}  // namespace jostle::common
