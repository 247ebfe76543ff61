#include "services/tools/doctor/listen.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include "services/common/process/domain.hpp"
#include "services/tools/doctor/echo.hpp"
#include "services/tools/doctor/facts.hpp"

namespace jostle::tools {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kIdle{60};         // an asker that says nothing for so long is gone
constexpr std::chrono::milliseconds kHear{1000};  // for a datagram that was sent already

// What one asker wants to know, until it leaves.
class Answers {
 public:
  Answers(const wire::Participant& participant, const Echo& echo, const std::function<std::vector<Check>()>& examine,
          in_addr asker)
      : participant_(participant),
        echo_(echo),
        examine_(examine),
        asker_(asker),
        through_(route_to(asker).value_or(any_address())) {}

  // Values of wrong types are exceptions of the JSON library.
  json to(const json& question) {
    try {
      const std::string what = question.at("ask");
      if (what == "facts") return to_json(facts_of(participant_.domain(), examine_()));
      if (what == "time") return {{"ns", wall_clock_ns()}};
      if (what == "echoes") return {{"heard", echo_.heard()}};
      if (what == "listen") return listen(question.at("multicast"));
      if (what == "heard") return {{"heard", ear_ && ear_->hears(datagram(question), Clock::now() + kHear)}};
      if (what == "send") return send(question);
      return {{"error", "no such question"}};
    } catch (const json::exception& problem) {
      return {{"error", problem.what()}};
    }
  }

 private:
  static std::string datagram(const json& question) { return test_datagram(question.at("text"), question.at("size")); }

  json listen(bool multicast) {
    auto ear_result = multicast ? Ear::open(common::multicast_port(participant_.domain()), through_)
                                : Ear::open_in_domain(participant_.domain());
    if (!ear_result) return {{"error", ear_result.error().message}};
    ear_ = std::move(ear_result).value();
    return {{"port", ear_->port()}};
  }

  json send(const json& question) const {
    const bool multicast = question.at("multicast");
    const in_addr to = multicast ? in_addr{inet_addr(kGroup)} : asker_;
    const auto ok =
        send_datagram(datagram(question), to, question.at("port"), multicast ? std::optional(through_) : std::nullopt);
    return ok ? json::object() : json{{"error", ok.error().message}};
  }

  const wire::Participant& participant_;
  const Echo& echo_;
  const std::function<std::vector<Check>()>& examine_;
  const in_addr asker_, through_;
  std::optional<Ear> ear_;
};

}  // namespace

void listen_to_peers(const wire::Participant& participant, Door door,
                     const std::function<std::vector<Check>()>& examine,
                     const std::function<void(const std::string&)>& notice, std::stop_token stop) {
  const Echo echo(participant);
  while (auto line = door.next(stop)) {
    const auto asker = line->other();
    if (!asker) continue;
    notice(to_string(*asker) + " asks");
    Answers answers(participant, echo, examine, *asker);
    while (const auto question = line->hear(Clock::now() + kIdle, stop)) {
      if (!line->say(answers.to(*question))) break;
    }
    notice(to_string(*asker) + " is done");
  }
}

}  // namespace jostle::tools
