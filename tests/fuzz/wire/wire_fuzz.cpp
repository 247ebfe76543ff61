// Spoilt samples and datagrams against the programs of a system.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>

#include <CLI/CLI.hpp>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "services/wire/dds/cdr.hpp"
#include "services/wire/dds/raw.hpp"
#include "services/wire/dds/system_topics.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/limits.hpp"
#include "tests/fuzz/wire/mutation.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/test_domain.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using jostle_msgs::msg::Goal;
using jostle_msgs::msg::GoalResult;

constexpr auto kPatience = 60s;
constexpr std::size_t kMostGrowth = 300;  // MB
constexpr std::size_t kKept = 8;          // samples of a topic to spoil
constexpr int kBurst = 100;               // between two breaths
// ms; from then on a forged datagram is known by its port.
constexpr int kAcquaintance = static_cast<int>(std::chrono::milliseconds(wire::limits::kShowsItsPorts).count()) + 1000;

struct Options {
  long samples = 2000, datagrams = 5000;
  std::uint64_t seed = 1;
};

struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

Bytes bytes_of(std::span<const std::byte> data) {
  const auto* begin = reinterpret_cast<const std::uint8_t*>(data.data());
  return {begin, begin + data.size()};
}

std::span<const std::byte> as_sample(const Bytes& bytes) { return std::as_bytes(std::span(bytes)); }

// A process that speaks everything and is trusted by nobody.
class Fuzzer {
 public:
  explicit Fuzzer(const Options& options) : options_(options), random_(options.seed) {
    scene_file_ = folder_.write("scene.yaml", physics_pool::to_yaml(three_objects()));
    start("jostle_worker", {"--threads", "2"});
    start("jostle_coordinator", {});
    start("jostle_sim", {scene_file_});
    start("jostle_record", {"/*", "-o", folder_.path() / "bag"});  // of the pool, too
    for (const wire::SystemTopic& topic : wire::system_topics()) listen(topic);
    goals_.emplace(participant_, topic_of(wire::topics::kTaskGoal));
    constexpr int kReaders = 3;  // the coordinator, the recorder, and ours
    if (!goals_->wait_for_readers(in(kPatience), kReaders)) throw Failure("no coordinator, or no recorder");
  }

  void run() {
    const std::string before = plan();
    const auto memory = peaks();
    fmt::print("plan {} before\n", before);
    send_samples();
    send_datagrams();
    check_alive();
    const std::string after = plan();
    fmt::print("plan {} after\n", after);
    if (after != before) throw Failure(fmt::format("the plan was {} before and is {} after", before, after));
    check_memory(memory);
    end();
  }

 private:
  template <class T>
  static wire::RawTopic topic_of(const wire::Topic<T>& topic) {
    wire::Serializer<T> serializer;
    return {topic.name, serializer.getName(), topic.qos};
  }

  void start(const std::string& name, std::vector<std::string> arguments) {
    arguments.insert(arguments.end(),
                     {"--domain", std::to_string(domain_), "--die-with-parent", std::to_string(getpid())});
    programs_.emplace_back(name, std::make_unique<ProgramProcess>(name, arguments, folder_));
  }

  // Keeps what the system itself says, to spoil it.
  void listen(const wire::RawTopic& topic) {
    readers_.push_back(std::make_unique<wire::RawReader>(
        participant_, topic, [this, name = topic.name](std::span<const std::byte> data, const wire::Origin& origin) {
          const std::lock_guard lock(mutex_);
          writers_[origin.participant] = origin.writer;
          auto& kept = heard_[name];
          if (kept.size() < kKept && origin.participant != participant_.id()) kept.push_back(bytes_of(data));
          if (name == wire::topics::kTaskResult.name) {
            if (auto result = wire::from_cdr<GoalResult>(data)) results_[result->goal_id()] = *result;
          }
          if (name == wire::topics::kPoolWorker.name && origin.participant != participant_.id()) {
            if (auto heartbeat = wire::from_cdr<jostle_msgs::msg::WorkerHeartbeat>(data)) worker_ = heartbeat->worker();
          }
        }));
  }

  static Goal goal(const std::string& id) {
    Goal goal;
    goal.goal_id(id);
    goal.execution_scene(physics_pool::to_yaml(three_objects()));
    goal.planning_scene(goal.execution_scene());
    goal.parameters("control: {many_iterations: 5, timeout: 60}\n");
    goal.controller("or");
    goal.seed(3);
    goal.plan_only(true);
    return goal;
  }

  // The hash of a plan that the system makes now. A coordinator that works on a spoilt goal refuses ours until it is
  // done.
  std::string plan() {
    const auto deadline = in(4 * kPatience);
    while (Clock::now() < deadline) {
      const std::string id = fmt::format("fuzz-{}", ++goals_sent_);
      if (!goals_->write(wire::to_cdr(goal(id)))) continue;
      std::optional<GoalResult> result;
      soon(kPatience, [&] {
        check_alive();
        const std::lock_guard lock(mutex_);
        if (const auto found = results_.find(id); found != results_.end()) result = found->second;
        return result.has_value();
      });
      if (!result) throw Failure(fmt::format("goal {} was not answered", id));
      if (result->ending() == jostle_msgs::msg::GoalResult_Constants::REFUSED) continue;
      if (!result->success()) throw Failure(fmt::format("goal {}: {} {}", id, result->reason(), result->error()));
      return nlohmann::json::parse(result->report())["plan_hash"];
    }
    throw Failure("the coordinator was busy with something else all the time");
  }

  void send_samples() {
    std::vector<wire::RawTopic> topics(wire::system_topics().begin(), wire::system_topics().end());
    topics.push_back(topic_of(wire::topics::pool_assignment(worker_)));
    const long each = options_.samples / static_cast<long>(topics.size()) + 1;
    long sent = 0;
    for (const wire::RawTopic& topic : topics) {
      if (topic.name == wire::topics::kTaskCancel.name) continue;  // whatever is right of it is meant
      wire::RawWriter writer(participant_, topic);
      writer.wait_for_readers(in(1s));
      std::vector<Bytes> seeds;
      {
        const std::lock_guard lock(mutex_);
        seeds = heard_[topic.name];
      }
      if (seeds.empty()) seeds.emplace_back(256, 0);
      for (long i = 0; i < each; ++i) {
        Bytes sample = mutated(seeds[random_() % seeds.size()], random_() % 8 == 0 ? 0 : 4, random_);
        if (sample.size() < 4) sample.resize(4);
        if (writer.write(as_sample(sample))) ++sent;
        if (i % kBurst == 0) breathe();
      }
      writer.wait_until_received(in(5s));
      check_alive();
    }
    fmt::print("{} samples\n", sent);
  }

  void send_datagrams() {
    poll(nullptr, 0, kAcquaintance);
    std::vector<Bytes> seeds;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& [participant, writer] : writers_) {
        for (const Bytes& parts : templates(writer)) seeds.push_back(parts);
      }
    }
    const int base = 7400 + 250 * domain_;
    const int socket_handle = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    for (long i = 0; i < options_.datagrams; ++i) {
      const Bytes datagram = mutated(seeds[random_() % seeds.size()], random_() % 4 == 0 ? 0 : 20, random_);
      sockaddr_in address{};
      address.sin_family = AF_INET;
      const int port = random_() % 9 == 0 ? base : base + 10 + static_cast<int>(random_() % 12);
      address.sin_port = htons(static_cast<in_port_t>(port));
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      sendto(socket_handle, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&address),
             sizeof address);
      if (i % kBurst == 0) breathe();
      if (i % 10'000 == 0) check_alive();
    }
    close(socket_handle);
    fmt::print("{} datagrams of {} kinds\n", options_.datagrams, seeds.size());
  }

  // One message of each kind of submessage, in a writer's name.
  static std::vector<Bytes> templates(const wire::Guid& writer) {
    const auto message = [&](std::initializer_list<std::pair<std::uint8_t, Bytes>> parts) {
      Bytes bytes{'R', 'T', 'P', 'S', 2, 3, 1, 15};
      bytes.insert(bytes.end(), writer.begin(), writer.begin() + 12);
      for (const auto& [kind, body] : parts) {
        bytes.insert(bytes.end(),
                     {kind, std::uint8_t(kind == 0x15 || kind == 0x16 ? 5 : 1), static_cast<std::uint8_t>(body.size()),
                      static_cast<std::uint8_t>(body.size() >> 8)});
        bytes.insert(bytes.end(), body.begin(), body.end());
      }
      return bytes;
    };
    const Bytes nobody{0, 0, 0, 0}, self(writer.begin() + 12, writer.end());
    const auto join = [](std::initializer_list<Bytes> parts) {
      Bytes all;
      for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
      return all;
    };
    const auto sequence = [](std::uint8_t number) { return Bytes{0, 0, 0, 0, number, 0, 0, 0}; };
    const Bytes count{9, 0, 0, 0}, payload = join({Bytes{0, 1, 0, 0}, Bytes(200, 7)});
    const Bytes data_head = join({Bytes{0, 0, 16, 0}, nobody, self, sequence(5)});
    return {message({{0x07, join({nobody, self, sequence(1), sequence(9), count})}}),
            message({{0x08, join({nobody, self, sequence(1), sequence(3), Bytes{32, 0, 0, 0}, Bytes(4, 0xf0)})}}),
            message({{0x06, join({self, self, sequence(3), Bytes{32, 0, 0, 0}, Bytes(4, 0xf0), count})}}),
            message({{0x15, join({data_head, payload})}}),
            message({{0x16, join({data_head, Bytes{1, 0, 0, 0, 1, 0, 0xc8, 0, 0, 8, 0, 0}, payload})}}),
            message({{0x12, join({self, self, sequence(3), Bytes{1, 0, 0, 0, 32, 0, 0, 0}, Bytes(4, 0xf0), count})}}),
            message({{0x13, join({nobody, self, sequence(3), Bytes{4, 0, 0, 0}, count})}}),
            message({{0x09, Bytes(8, 1)},
                     {0x0c, join({nobody, Bytes{2, 3, 1, 15}, Bytes(writer.begin(), writer.begin() + 12)})},
                     {0x07, join({nobody, self, sequence(1), sequence(9), count})},
                     {0x80, Bytes(56, 0)}}),
            message({{0x0e, Bytes(writer.begin(), writer.begin() + 12)}, {0x15, join({data_head, payload})}})};
  }

  // What is sent faster than it is read is lost in the kernel, and tries nothing.
  static void breathe() { poll(nullptr, 0, 2); }

  void check_alive() {
    for (auto& [name, program] : programs_) {
      if (program->code()) throw Failure(fmt::format("{} ended with {}: {}", name, *program->code(), program->err()));
    }
  }

  std::vector<std::size_t> peaks() const {
    std::vector<std::size_t> result;
    for (const auto& [name, program] : programs_) result.push_back(peak_memory(program->pid()));
    return result;
  }

  void check_memory(const std::vector<std::size_t>& before) const {
    const auto after = peaks();
    for (std::size_t i = 0; i < after.size(); ++i) {
      fmt::print("{}: {} MB before, {} MB after\n", programs_[i].first, before[i], after[i]);
      if (after[i] > before[i] + kMostGrowth) throw Failure(fmt::format("{} grew", programs_[i].first));
    }
  }

  void end() {
    for (const auto& [name, program] : programs_) program->signal(SIGTERM);
    for (const auto& [name, program] : programs_) {
      const auto code = program->wait(kPatience);
      if (code != 0) throw Failure(fmt::format("{} ended with {}: {}", name, code.value_or(-1), program->err()));
    }
  }

  const Options options_;
  std::mt19937_64 random_;
  const int domain_ = test_domain();
  const TempFolder folder_;
  std::string scene_file_;
  std::vector<std::pair<std::string, std::unique_ptr<ProgramProcess>>> programs_;
  const wire::Participant participant_ = wire::Participant::open({.name = "fuzz", .domain = domain_}).value();

  std::mutex mutex_;  // guards what the readers fill
  std::map<std::string, std::vector<Bytes>> heard_;
  std::map<std::uint64_t, wire::Guid> writers_;  // one of each participant
  std::map<std::string, GoalResult> results_;
  std::uint64_t worker_ = 0;

  int goals_sent_ = 0;
  std::optional<wire::RawWriter> goals_;
  std::vector<std::unique_ptr<wire::RawReader>> readers_;  // last: they fill the above
};

}  // namespace
}  // namespace jostle::tests

int main(int argc, char** argv) {
  using namespace jostle::tests;
  CLI::App app("Sends spoilt samples and datagrams to the programs of a system, and looks at what becomes of them.");
  Options options;
  app.add_option("--samples", options.samples, "Of all topics together")->capture_default_str();
  app.add_option("--datagrams", options.datagrams, "To all ports together")->capture_default_str();
  app.add_option("--seed", options.seed, "Of what is spoilt and how")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    Fuzzer(options).run();
    return 0;
  } catch (const std::exception& failure) {
    fmt::print(stderr, "FAILED (--seed {}): {}\n", options.seed, failure.what());
    return 1;
  }
}
