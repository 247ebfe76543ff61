#pragma once
/// \file
/// What all command lines have in common beside parsing: mistakes in our words, completion, manual pages. All of it
/// comes from the options as CLI11 has them.

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace CLI {
class App;
class Option;
class Validator;
class ParseError;
}  // namespace CLI

namespace jostle::common {

/// Names values that an option takes, for completion; those that its check lists (CLI::IsMember) need no more. An
/// option of text without any is completed with files; `values` empty: with nothing.
void suggest(CLI::Option* option, const std::vector<std::string>& values);

/// Adds an option for the seed of random numbers, a whole number of 64 bits: a longer one is refused, where CLI11 would
/// take the largest.
CLI::Option* add_seed_option(CLI::App& app, const std::string& name, std::uint64_t& seed, const std::string& help);

/// Checks that an option's value is a port from `least` on; an option that may stand without one passes so, too.
CLI::Validator port(int least = 0);

/// Says what is wrong with a command line that CLI11 refused, with the program's name before it: what was got, what is
/// wanted, or which option was meant.
std::string explain(const CLI::App& app, const CLI::ParseError& error);

/// Returns the help of a subcommand, or of the program where `words` is empty. Error kNotFound: no such subcommand;
/// says which there are, or which was meant.
Result<std::string> help_of(const CLI::App& app, const std::vector<std::string>& words);

/// Lists what may stand at the place of the last of `words`, whatever it is so far, a line each: "WORD" or
/// "WORD\tMEANING"; ":files" is any file.
std::vector<std::string> completions(const CLI::App& app, const std::vector<std::string>& words);

/// Writes the program's manual page, man(7). `purpose` is one line.
std::string manual_page(const CLI::App& app, const std::string& purpose);

/// Says that all programs end with the same codes, unless the program's own words on it are in the footer.
void document_exit_codes(CLI::App& app);

}  // namespace jostle::common
