// Mutated bags through info, verify, recover and export: no crash, no hang, no growth, and every message that was met
// is taken or counted as lost. The same seed does the same.

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>

#include "services/bags/format/folder_reader.hpp"
#include "services/bags/tool/commands.hpp"
#include "tests/fuzz/bags/bags.hpp"
#include "tests/fuzz/bags/walker.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::fuzz {
namespace {

namespace fs = std::filesystem;

// One case takes milliseconds; on a busy machine, under sanitizers, a hundred times that.
constexpr int kPatience = 60;                    // s
constexpr std::uint64_t kMostGrowth = 48 << 20;  // bytes, after the first cases
constexpr std::uint64_t kWarmUp = 300;           // cases

// For signal handlers.
std::uint64_t seed = 1, current = 0;
int out = STDERR_FILENO;  // whatever is silenced

void end_with(const char* what) {
  char text[160];
  const int size = std::snprintf(text, sizeof text, "%s: --seed %llu --case %llu\n", what,
                                 static_cast<unsigned long long>(seed), static_cast<unsigned long long>(current));
  if (::write(out, text, static_cast<std::size_t>(size)) < 0) _exit(4);
  _exit(3);
}

std::uint64_t resident() {
  std::ifstream in("/proc/self/statm");
  std::uint64_t all = 0, pages = 0;
  in >> all >> pages;
  return pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

// What the commands print goes nowhere while this lives.
class Silence {
 public:
  Silence() {
    std::fflush(nullptr);
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
      kept_[stream] = dup(stream);
      const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
      dup2(nowhere, stream);
      close(nowhere);
    }
  }
  ~Silence() {
    std::fflush(nullptr);
    for (const auto& [stream, kept] : kept_) {
      dup2(kept, stream);
      close(kept);
    }
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  std::map<int, int> kept_;
};

struct Count {
  std::uint64_t taken = 0, lost = 0, repeated = 0;
  bool ended_well = false;
};

std::optional<Count> count(const fs::path& bag, bool recover) {
  auto reader_result = bags::open_bag(bag, recover);
  if (!reader_result) return {};
  bags::CheckedReader& reader = **reader_result;
  Count count;
  while (true) {
    const auto message = reader.next();
    count.ended_well = message.has_value();
    if (!message || !*message) break;
    ++count.taken;
  }
  bags::Findings findings;
  findings.add_all(reader.findings());
  count.lost = findings.count_lost(bags::Part::kMessage);
  count.repeated = reader.repeated();
  return count;
}

class Case {
 public:
  Case(const Files& seed_bag, std::uint64_t number, const fs::path& scratch)
      : dice_(seed * 1'000'003 + number), bag_(seed_bag), scratch_(scratch), folder_(scratch / "case") {}

  // What is wrong, if anything.
  std::optional<std::string> run() {
    what_ = mutate(bag_, dice_, scratch_);
    write();
    const fs::path bag = bag_.size() == 1 ? folder_ / bag_.front().first : folder_;
    auto problem = try_commands(bag);
    fs::remove_all(folder_);
    fs::remove_all(scratch_ / "saved");
    return problem;
  }
  const std::string& what() const { return what_; }
  void keep(const fs::path& folder) const {
    fs::create_directories(folder);
    for (const auto& [name, bytes] : bag_) std::ofstream(folder / name, std::ios::binary) << bytes;
  }

 private:
  void write() {
    fs::create_directories(folder_);
    for (const auto& [name, bytes] : bag_) std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }

  Met met() const {
    Met all;
    for (const auto& [name, bytes] : bag_) {
      const bool is_mcap = name.ends_with(".mcap");
      if (!is_mcap && !name.ends_with(".db3")) continue;  // no part of a bag, whatever is in it
      const Met one = is_mcap ? walk_mcap(bytes) : count_database(folder_ / name);
      all.messages += one.messages;
      all.is_exact = all.is_exact && one.is_exact;
    }
    return all;
  }

  std::optional<std::string> try_commands(const fs::path& bag) {
    const fs::path saved = scratch_ / "saved";
    int verified = 0, recovered = 0;
    {
      const Silence silence;
      bags::show_info({.bag = bag, .as_json = true});
      verified = bags::verify_bag(bag, {});
      recovered = bags::recover_bag({.bag = bag, .output = saved}, {});
      bags::export_bag({.bag = bag, .as_csv = false, .topics = {}, .output = "/dev/null"}, {});
    }
    const Met there = met();
    const auto read = count(bag, false), rescued = count(bag, true);
    if (rescued) {
      const std::uint64_t accounted = rescued->taken + rescued->repeated + rescued->lost;
      if (!rescued->ended_well) return "recovering ends with an error";
      if (there.is_exact ? accounted != there.messages : accounted < there.messages) {
        return fmt::format("recover: {} taken + {} repeated + {} lost, met {}{}", rescued->taken, rescued->repeated,
                           rescued->lost, there.messages, there.is_exact ? "" : " or more");
      }
      if (recovered == 0 && rescued->lost > 0) return fmt::format("recover: 0 with {} lost", rescued->lost);
      const auto back = count(saved, false);
      if (recovered <= 1 && (!back || !back->ended_well || back->taken != rescued->taken)) {
        return fmt::format("recover: the new bag has {} messages, wanted {}", back ? back->taken : 0, rescued->taken);
      }
    } else if (there.messages > 0 && there.is_exact) {
      return fmt::format("recover: nothing of {} messages", there.messages);
    }
    if (verified == 0 && (!read || !read->ended_well || read->lost > 0 ||
                          (there.is_exact && read->taken + read->repeated != there.messages))) {
      return fmt::format("verify: ok with {} taken of {} that are there", read ? read->taken : 0, there.messages);
    }
    return {};
  }

  Dice dice_;
  Files bag_;
  const fs::path scratch_, folder_;
  std::string what_;
};

int run(std::uint64_t cases, std::optional<std::uint64_t> only, const std::string& keep) {
  const tests::TempFolder scratch;
  const std::vector<Files> seeds = seed_bags(scratch.path());
  std::uint64_t failures = 0, begin = 0;
  double slowest = 0.0;
  for (std::uint64_t i = only.value_or(0); i < (only ? *only + 1 : cases); ++i) {
    current = i;
    timeval before{}, after{};
    gettimeofday(&before, nullptr);
    alarm(kPatience);
    Case one(seeds[i % seeds.size()], i, scratch.path());
    const auto problem = one.run();
    alarm(0);
    gettimeofday(&after, nullptr);
    slowest = std::max(slowest, static_cast<double>(after.tv_sec - before.tv_sec) +
                                    1e-6 * static_cast<double>(after.tv_usec - before.tv_usec));
    if (problem) {
      ++failures;
      fmt::print("--seed {} --case {}: {} ({})\n", seed, i, *problem, one.what());
    }
    if (!keep.empty() && (problem || only)) one.keep(fs::path(keep) / std::to_string(i));
    if (i == kWarmUp) begin = resident();
    if (begin > 0 && resident() > begin + kMostGrowth) {
      fmt::print("--seed {} --case {}: memory grew from {} to {} bytes\n", seed, i, begin, resident());
      return 1;
    }
  }
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  fmt::print("{} cases, {} failed; slowest {:.2f} s; most memory {} MB, grown by {} kB since case {}\n",
             only ? 1 : cases, failures, slowest, used.ru_maxrss / 1024,
             begin > 0 ? (static_cast<std::int64_t>(resident()) - static_cast<std::int64_t>(begin)) / 1024 : 0,
             kWarmUp);
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace jostle::fuzz

int main(int argc, char** argv) {
  using namespace jostle::fuzz;
  CLI::App app("Mutates bags, and runs `jostle bag` on each in this process.", "jostle_fuzz_bags");
  std::uint64_t cases = 300;
  std::optional<std::uint64_t> only;
  std::string keep;
  app.add_option("--cases", cases, "How many")->capture_default_str();
  app.add_option("--seed", seed, "Of all random numbers")->capture_default_str();
  app.add_option("--case", only, "Only this one");
  app.add_option("--keep", keep, "Folder for bags that failed");
  CLI11_PARSE(app, argc, argv);
  out = dup(STDERR_FILENO);
  signal(SIGALRM, [](int) { end_with("hangs"); });
  for (const int crash : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE}) signal(crash, [](int) { end_with("crashes"); });
  return run(cases, only, keep);
}
