#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::interchange {

/// What a program and the agent that brakes its rig share: a file of `size` bytes that the agent makes and both map
/// (abs_hil.learning.rig_environment). Numbers have the computer's byte order.
struct AgentPage {
  static constexpr std::size_t size = 4096;
  static constexpr std::array<char, 8> right_mark{'a', 'b', 's', 'a', 'g', 't', '0', '1'};

  std::array<char, 8> mark;
  double hold_s;  ///< an action that is older brakes no more
  /// The agent's: a number that it raises with each action (high half), the action as a float (low half). One word, so
  /// that both always belong together.
  std::atomic<std::uint64_t> action;
  /// The program's: odd while it writes the values.
  std::atomic<std::uint64_t> version;
  /// In the order of AgentController::Value.
  std::array<std::atomic<double>, 11> values;
};
static_assert(sizeof(AgentPage) <= AgentPage::size && std::atomic<double>::is_always_lock_free);

/// A slip controller from a file FILE.agent, whose torque an agent in another process chooses at its own pace, such as
/// a learner. Each step it shows the agent what controllers get, and brakes with the agent's latest action: a share of
/// the largest torque, in [0, 1]. It never waits. An action that is older than the page's hold_s, that is no number or
/// lies outside [0, 1], brakes with 0. Real-time safe but for its construction.
class AgentController final : public control::SlipController {
 public:
  enum Value : std::size_t {
    time_s,  ///< of braking
    slip,
    slip_ref,
    car_speed_m_s,
    alpha1_rad_s2,
    alpha2_rad_s2,
    brake_torque_Nm,
    max_brake_torque_Nm,
    acting_number,  ///< of the action that acts now; 0: none
    late_cycles,    ///< so far without an action in time
    refused,        ///< actions that were no number in [0, 1]
  };

  /// Throws std::invalid_argument, which names the file, if it is no page of an agent.
  AgentController(const std::string& file, const control::ControllerContext& context);
  AgentController(const AgentController&) = delete;
  AgentController& operator=(const AgentController&) = delete;
  ~AgentController() override;

  void reset(const control::SlipInput& input) noexcept override;
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override;
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override { return signals_; }

 private:
  void take_action(double dt_s) noexcept;
  void show(const control::SlipInput& input) noexcept;

  AgentPage* page_{nullptr};
  double hold_s_;  ///< of the page, which the agent may change, as it was at first
  double r2_m_;
  double full_torque_Nm_;  ///< of a brake without an upper end
  std::uint32_t number_{0};
  double action_{0.0};
  double age_s_{0.0};
  bool acts_{false};
  double time_s_{0.0};
  double late_cycles_{0.0};
  double refused_{0.0};
  std::array<rig::Signal, 2> signals_{
      {{"agent_action", "action of the agent that acts, as a share of the largest torque"},
       {"agent_age_s", "time since the agent's latest action"}}};
};

}  // namespace abs_hil::interchange
