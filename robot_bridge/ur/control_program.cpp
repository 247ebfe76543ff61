#include "robot_bridge/ur/control_program.hpp"

#include <fmt/format.h>

namespace jostle::robot_bridge::ur {
namespace {

std::string six_registers() {
  std::string list;
  for (int i = 0; i < 6; ++i) {
    list += fmt::format("{}read_input_float_register({})", i == 0 ? "" : ", ", contract::kBase + i);
  }
  return list;
}

}  // namespace

std::string control_program(double cycle, double watchdog) {
  using namespace contract;
  // The registers keep what they were told, and the loop obeys it again: only the watchdog ends a speed that nobody
  // renews.
  return fmt::format(
      "def {name}():\n"
      "  rtde_set_watchdog(\"input_int_register_{base}\", {watchdog}, \"stop\")\n"
      "  write_output_integer_register({second}, 0)\n"
      "  write_output_integer_register({base}, {ready})\n"
      "  command = {hold}\n"
      "  while command != {exit}:\n"
      "    command = read_input_integer_register({base})\n"
      "    number = read_input_integer_register({second})\n"
      "    if command == {speeds}:\n"
      "      speedj([{six}], read_input_float_register({seventh}), {cycle})\n"
      "    elif command == {positions}:\n"
      "      servoj([{six}], 0, 0, {cycle}, 0.1, 300)\n"
      "    else:\n"
      "      stopj({deceleration})\n"
      "      sync()\n"
      "    end\n"
      "    write_output_integer_register({second}, number)\n"
      "  end\n"
      "  stopj({deceleration})\n"
      "  write_output_integer_register({base}, 0)\n"
      "end\n",
      fmt::arg("name", kName), fmt::arg("base", kBase), fmt::arg("second", kBase + 1), fmt::arg("seventh", kBase + 6),
      fmt::arg("watchdog", watchdog), fmt::arg("ready", kReady), fmt::arg("hold", static_cast<int>(kHold)),
      fmt::arg("exit", static_cast<int>(kExit)), fmt::arg("speeds", static_cast<int>(kSpeeds)),
      fmt::arg("positions", static_cast<int>(kPositions)), fmt::arg("six", six_registers()), fmt::arg("cycle", cycle),
      fmt::arg("deceleration", kStopDeceleration));
}

}  // namespace jostle::robot_bridge::ur
