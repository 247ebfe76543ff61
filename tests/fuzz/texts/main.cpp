// Mutated texts, by the thousand: whatever they hold, they are taken or refused in words, in a moment, and leave
// nothing.

#include <fmt/format.h>
#include <malloc.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/texts/subjects.hpp"
#include "tests/support/temp_folder.hpp"

namespace {

using namespace jostle::tests;
using Clock = std::chrono::steady_clock;

constexpr unsigned kPatience = 60;             // seconds for one text, on however busy a machine
constexpr std::size_t kMostGrowth = 64 << 20;  // bytes, once a tenth of the texts has been read
constexpr std::size_t kMostShare = 10;         // of the texts before growth is measured

char at_work[256];  // for the signal handler: which text

void tell_and_end(int signal) {
  const char* words = signal == SIGALRM ? "hangs: " : "crashes: ";
  (void)!write(STDERR_FILENO, words, std::strlen(words));
  (void)!write(STDERR_FILENO, at_work, std::strlen(at_work));
  _exit(1);
}

std::size_t resident_bytes() {
  malloc_trim(0);
  std::size_t pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

std::size_t descriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

std::string case_text(const Subject& subject, std::uint64_t seed, std::uint64_t number) {
  Dice dice(seed * 1'000'003 + number * 7919 + subject.name.size());
  return mutated(dice.one_of(subject.originals), subject.grammar, subject.originals, dice);
}

// Whether all of one subject's texts behaved.
bool try_all(const Subject& subject, std::uint64_t seed, std::uint64_t first, std::uint64_t cases) {
  std::uint64_t taken = 0;
  double slowest = 0.0;
  std::uint64_t slowest_case = 0;
  std::size_t bytes_before = resident_bytes(), descriptors_before = descriptors();
  const auto start = Clock::now();
  for (std::uint64_t i = first; i < first + cases; ++i) {
    std::snprintf(at_work, sizeof at_work, "%s --seed %llu --first %llu --cases 1\n", subject.name.c_str(),
                  static_cast<unsigned long long>(seed), static_cast<unsigned long long>(i));
    const std::string text = case_text(subject, seed, i);
    const auto before = Clock::now();
    alarm(kPatience);
    try {
      taken += subject.read(text);
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}: {}", error.what(), at_work);
      return false;
    }
    alarm(0);
    const double seconds = std::chrono::duration<double>(Clock::now() - before).count();
    if (seconds > slowest) {
      slowest = seconds;
      slowest_case = i;
    }
    if (i - first == cases / kMostShare) bytes_before = resident_bytes();
  }
  const std::size_t bytes = resident_bytes(), grown = bytes > bytes_before ? bytes - bytes_before : 0;
  fmt::print("{:<11} {} texts, {} taken, {:.1f} s, slowest {:.3f} s (number {}), grown by {} KiB\n", subject.name,
             cases, taken, std::chrono::duration<double>(Clock::now() - start).count(), slowest, slowest_case,
             grown >> 10);
  std::fflush(stdout);
  if (grown > kMostGrowth) fmt::print(stderr, "{}: grew by {} bytes\n", subject.name, grown);
  if (descriptors() > descriptors_before) fmt::print(stderr, "{}: left files open\n", subject.name);
  return grown <= kMostGrowth && descriptors() <= descriptors_before;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Mutates scenes, parameters, networks, profiles and keystores and has them read.", "jostle_fuzz_texts");
  std::uint64_t cases = 5000, seed = 1, first = 0;
  std::string only;
  bool shows = false;
  app.add_option("--cases", cases, "Texts of each kind")->capture_default_str();
  app.add_option("--seed", seed, "Equal seeds give equal texts")->capture_default_str();
  app.add_option("--first", first, "Number of the first text")->capture_default_str();
  app.add_option("--only", only, "One kind: scenes, parameters, networks, profiles or keystores");
  app.add_flag("--show", shows, "Print the texts instead");
  CLI11_PARSE(app, argc, argv);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM}) ::signal(signal, tell_and_end);
  const TempFolder folder;
  bool are_fine = true;
  for (const Subject& subject : make_subjects(folder.path())) {
    if (!only.empty() && subject.name != only) continue;
    if (!shows) are_fine = try_all(subject, seed, first, cases) && are_fine;
    for (std::uint64_t i = first; shows && i < first + cases; ++i) fmt::print("{}", case_text(subject, seed, i));
  }
  return are_fine ? 0 : 1;
}
