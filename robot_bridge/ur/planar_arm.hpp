#pragma once
/// \file
/// A Universal Robots arm whose hand moves in a plane: what a bridge drives.

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "idl/types/result.hpp"
#include "robot_bridge/planar/arm_in_plane.hpp"
#include "robot_bridge/safety/mailbox.hpp"
#include "robot_bridge/ur/calibration.hpp"
#include "robot_bridge/ur/dashboard.hpp"
#include "robot_bridge/ur/primary.hpp"
#include "robot_bridge/ur/rtde_client.hpp"

namespace jostle::robot_bridge::ur {

struct PlanarArmOptions {
  std::string host = "127.0.0.1";
  std::uint16_t rtde_port = rtde::kPort, dashboard_port = kDashboardPort, script_port = primary::kSecondaryPort;
  planar::Mounting mounting;
  /// s without a word from here that stop the arm, by our program on the controller; three times as long without one
  /// from there, and the connection counts as lost. On a machine that is not the bridge's alone a little longer.
  double watchdog = 1.0 / contract::kWatchdog;
  bool powers_up = true;  ///< whether it may switch the arm on, and release its brakes
  bool recovers = true;   ///< whether it may unlock a protective stop, 5 s after it
};

/// A PlanarArm keeps a connection to the controller, gets the arm ready, keeps our program running on it, and moves the
/// hand in its plane in each cycle of the controller.
///
/// A thread of its own meets each cycle: it takes the sample, decides, and answers. It shares nothing with others but
/// mailboxes. Another one gets the arm ready: power, brakes, stops, our program; it comes and goes as the controller
/// does.
///
/// Safety  the arm stands still unless a motion was asked for after the arm became ready, and is not over: whatever
///         happens to arm or connection ends the motion for good. When this process dies or stalls, our program on
///         the controller misses its registers within 1/contract::kWatchdog s and stops the arm; a lost cable likewise.
class PlanarArm {
 public:
  /// What it is up to.
  struct Report {
    ArmState state;                   ///< of the newest sample
    planar::PlanarPose hand;          ///< measured
    planar::PlanarVelocity velocity;  ///< measured
    bool is_connected = false;
    bool is_ready = false;                 ///< it would move if asked to
    std::uint64_t over = 0;                ///< the newest motion that is over
    bool failed = false;                   ///< whether that one ended early
    std::uint64_t cycles = 0, missed = 0;  ///< samples that came, and that were skipped
  };

  /// Begins; the arm is ready when report() says so.
  explicit PlanarArm(const PlanarArmOptions& options);
  /// The arm is stopped first.
  ~PlanarArm();
  PlanarArm(const PlanarArm&) = delete;
  PlanarArm& operator=(const PlanarArm&) = delete;

  /// Moves the hand for `duration` s; returns the motion's number. Ends the motion before.
  std::uint64_t move(const planar::PlanarVelocity& velocity, double duration);
  /// Ends the motion at work.
  void halt();

  /// Returns the newest report. With move() and halt(): one thread.
  const Report& report();

  /// Says why the arm is not ready, or why the last motion failed; "" if all is well. Any thread.
  std::string trouble() const;

  /// Returns how far the connected arm is from the arm as drawn; nothing before its controller told. An arm that is too
  /// far off does not get ready. Any thread.
  std::optional<CalibrationError> calibration() const;

 private:
  struct Order {
    std::uint64_t number = 0;  // 0: none yet
    planar::PlanarVelocity velocity;
    double duration = 0.0;  // s; 0: stand still
  };

  // The control thread's.
  void control(std::stop_token stop);
  void meet_cycles(RtdeClient& rtde, std::stop_token stop);
  ArmCommand decide(const ArmState& state, double dt);
  bool is_ready(const ArmState& state) const;
  void end_motion(const std::string& why);
  void leave(const std::string& why);
  // The other thread's.
  void tend(std::stop_token stop);
  Result<void> get_ready(const ArmState& state, const std::stop_token& stop);
  Result<void> look_at_calibration();

  void say(const std::string& trouble);

  const PlanarArmOptions options_;
  Mailbox<Order> orders_;
  Mailbox<Report> reports_, tended_;
  Report newest_;            // of who calls report()
  std::uint64_t asked_ = 0;  // motions

  mutable std::mutex mutex_;  // guards the two below; not for cycles in which all is well
  std::string trouble_;
  std::optional<CalibrationError> calibration_;

  // Of the control thread.
  planar::ArmInPlane in_plane_;
  Order order_;
  double left_ = 0.0;  // s, of the motion
  bool moves_ = false;
  Report report_;
  std::int32_t number_ = 0;             // of the newest command
  std::atomic<std::uint64_t> held_{0};  // cycles in a row that the registers have said: stand still
  std::atomic<double> cycle_{0.008};    // s

  std::jthread control_, tending_;  // last: they use all of the above
};

}  // namespace jostle::robot_bridge::ur
