#pragma once
/// \file
/// A Robotiq 2F-85: its variables, and what they mean. No sockets here.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace jostle::robot_bridge::robotiq {

/// Where the controller serves the gripper (TCP).
inline constexpr std::uint16_t kPort = 63352;

/// STA and OBJ as the gripper numbers them.
enum class Status : int { kReset = 0, kActivating = 1, kActive = 3 };
enum class Object : int { kMoving = 0, kMetWhileOpening = 1, kMetWhileClosing = 2, kAtRequest = 3 };

/// FLT.
std::string_view fault_text(int fault);

/// The range of the positions that it reports: open, and closed with the fingers touching.
inline constexpr int kOpenCount = 3, kClosedCount = 230;
inline constexpr double kStroke = 0.085;                     ///< m
inline constexpr double kSlowest = 0.020, kFastest = 0.150;  ///< m/s, of the opening, at SPE 0 and 255

/// Returns the opening, m, of a reported position; and the other way round. Positions are proportional to the angle of
/// the linkage, openings are not.
double opening_of(int position);
int position_of(double opening);

/// Returns the slowest SPE that is at least as fast as `speed`, m/s.
int speed_count(double speed);
double speed_of(int count);  ///< m/s

/// Returns the requests of the protocol, with their end.
std::string set_request(std::string_view variable, int value);
std::string move_request(int position, int speed, int force);
std::string get_request(std::string_view variable);

/// Reads "OBJ 3"; nothing if it is no answer about that variable.
std::optional<int> read_answer(std::string_view variable, std::string_view line);

}  // namespace jostle::robot_bridge::robotiq
