#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

/// One frame on the emulated node's bus.
struct BusFrame {
  std::uint32_t id{0};  ///< 11 bits
  std::uint8_t length{0};
  bool fd{false};
  std::array<std::uint8_t, 64> data{};
};

/// Puts the correct checksum into a frame's last byte.
void seal(BusFrame& frame) noexcept;

/// Properties of the emulated node. This project chose limits and supply, as for the emulated card.
struct CanNodeOptions {
  plant_sim::PlantOptions plant{};
  double start_speed_rad_s{0.0};  ///< both wheels' speed at power-on, >= 0
  std::uint16_t watchdog_ms{20};  ///< until an activation sets another value
  bool lock_step{false};          ///< only ABS_TIME advances the time
  bool can_fd{true};              ///< answers a SYNC in an FD frame with an FD frame
  double supply_V{24.0};
  double supply_min_V{15.0};
  double temperature_C{30.0};
  double temperature_max_C{90.0};
  double overspeed_rpm{2200.0};
};

/// The CAN I/O node of docs/can.md with the simulated rig behind it. It latches its counters at a SYNC, applies
/// commands, and zeroes its outputs when valid commands stop. It was written only from config/can/abs_rig.dbc and
/// shares no code with the driver.
class CanNode final : public RigBehind {
 public:
  enum class State : std::uint8_t { inactive = 0, active = 1, latched = 2 };

  /// Throws std::invalid_argument if an option is outside its range.
  explicit CanNode(const CanNodeOptions& options);

  /// Takes any frame from the bus at the current time.
  void receive(const BusFrame& frame);
  /// The frames that it has sent since the last call, in order.
  [[nodiscard]] std::vector<BusFrame> take_answers();
  [[nodiscard]] OutputLog& log() noexcept { return log_; }

  // Events from outside the rig.
  void set_supply_V(double volts) noexcept { options_.supply_V = volts; }
  void set_temperature_C(double celsius) noexcept { options_.temperature_C = celsius; }
  void trip_overspeed() noexcept { overspeed_latched_ = true; }
  /// Fault of the power stage: from now on the brake's duty differs by `error` from the command.
  void break_brake_output(double error) noexcept { brake_error_ = error; }

  [[nodiscard]] Outputs outputs() const noexcept override;
  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] std::uint32_t trip_flags() const noexcept;
  /// Number of received activations, deactivations and commands, valid or not.
  [[nodiscard]] std::uint64_t writes() const noexcept { return writes_; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }

 private:
  void on_time(const BusFrame& frame);
  void on_sync(const BusFrame& frame);
  void on_command(const BusFrame& frame);
  void on_control(const BusFrame& frame);
  void activate(const BusFrame& frame);
  void become(State state, std::uint8_t latch_reason, const std::string& why);
  void reject(const char* why);
  void check_interlocks();
  void note_outputs(const std::string& why) { log_.note(time_ns(), outputs(), why, last_command_ns_); }
  [[nodiscard]] std::uint8_t trips_and_state() const noexcept;
  /// Puts the duties that act, brake first.
  void put_applied(BusFrame& frame, std::size_t first) const;
  void send(BusFrame frame);
  void send_status();
  void send_outputs();
  void send_encoders(bool fd);
  void send_identity();
  [[nodiscard]] bool guarded() const noexcept { return state_ == State::active && (brake_ > 0.0 || drive_ > 0.0); }
  [[nodiscard]] std::int64_t watchdog_ends_ns() const noexcept;
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override;
  void after_step(const plant_sim::PlantState& before, std::int64_t from_ns) override;

  CanNodeOptions options_;
  State state_{State::inactive};
  std::uint8_t latch_reason_{0};
  double brake_{0.0};
  double drive_{0.0};
  double brake_error_{0.0};
  std::uint16_t nonce_{0x1234};
  std::uint8_t sync_sequence_{0};
  std::uint8_t command_sequence_{0};
  std::int64_t last_command_ns_{-1};  ///< time of the last accepted command; -1: none since the activation
  int reject_level_{0};
  std::uint64_t rejected_{0};
  std::uint64_t writes_{0};
  std::uint32_t syncs_{0};
  bool status_due_{true};
  std::uint32_t trip_told_{0};
  std::int64_t upper_zero_{0};
  std::int64_t lower_zero_{0};
  bool host_time_known_{false};
  std::uint64_t host_time_{0};
  std::vector<BusFrame> answers_{};
  OutputLog log_{"last valid command"};
};

/// Applies a fault between a node and its bus. The names are those of the control command `fault NAME[=NUMBER]`.
class NodeFaults {
 public:
  explicit NodeFaults(std::uint64_t seed) : random_(seed) {}

  /// Sets a fault such as "stale=5". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  /// True if the node receives this frame.
  [[nodiscard]] bool hears(const BusFrame& frame) const noexcept;
  /// The frames of one answer that reach the bus.
  [[nodiscard]] std::vector<BusFrame> answer(std::vector<BusFrame> frames);

 private:
  struct Row;
  static const std::array<Row, 16> rows;

  std::size_t row_{0};
  unsigned number_{0};
  std::vector<BusFrame> kept_{};
  std::mt19937_64 random_;
};

}  // namespace abs_hil::emulator
