#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "driver/can/bus.hpp"
#include "driver/factory.hpp"
#include "driver/hm2/hm2_driver.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::diagnosis {

/// Severity of a finding. A note needs no action, a warning costs quality, and after a failure the backend cannot run.
enum class Standing : std::uint8_t { good, note, warning, failure };

/// The result of examining one item of this computer.
struct Finding {
  std::string check;  ///< name of its check, as in `abs_hil doctor --only CHECK`
  std::string what;   ///< the item, as "SCHED_FIFO priority 80"
  Standing standing{Standing::good};
  std::string detail{};  ///< the observation
  std::string fix{};     ///< commands or advice, one per line; empty if no action is needed
};

/// One line per finding, with detail and fix below it.
[[nodiscard]] std::string to_text(std::span<const Finding> findings);
[[nodiscard]] nlohmann::ordered_json to_json(std::span<const Finding> findings);
/// The worst standing of the findings; `good` if there are none.
[[nodiscard]] Standing worst(std::span<const Finding> findings) noexcept;

/// Findings of the check "boards": each board that a backend has found, and what keeps a run from using it. A missing
/// board is a note.
[[nodiscard]] std::vector<Finding> judge(std::string_view kind, const std::vector<driver::FoundBoard>& boards);

/// Names of the checks of `examine`, in its order.
[[nodiscard]] std::vector<std::string> check_names();

/// Options of an examination.
struct Examination {
  std::string only{};  ///< one of check_names(), or empty for all
  std::string lcm_url{};
  runtime::RealtimeOptions realtime{};
  std::string backend{"sim"};
  double rate_Hz{1000.0};          ///< cycles per second, for the bus load
  driver::DriverOptions driver{};  ///< where each backend looks for its boards
  /// Makes the driver of the backend. It may throw driver::Unavailable, and so may the driver's `configure`.
  std::function<std::unique_ptr<driver::RigDriver>()> make_driver{};
  /// Throws driver::Unavailable if the configured board needs a commissioning first. Empty: it needs none.
  std::function<void(const driver::RigDriver&)> require_commissioned{};
};

/// Examines this computer. It obtains real-time scheduling in a thread of its own to check that it is available; memory
/// stays locked. It configures the backend's driver, which moves nothing. Only the backend's check can fail.
[[nodiscard]] std::vector<Finding> examine(const Examination& examination);

/// The result of the examination. All checks: true if the backend can run. A single check: true if nothing in it needs
/// a fix.
[[nodiscard]] bool turned_out_well(const Examination& examination, std::span<const Finding> findings);

/// Whether this kernel supports CAN sockets (PF_CAN, raw).
[[nodiscard]] bool has_can_sockets() noexcept;

/// Findings of the check "can": each interface with its state, its bit rate and the load of a run at `rate_Hz`. A
/// missing interface, or missing kernel support, is a note. The load of a vcan interface is meaningless.
[[nodiscard]] std::vector<Finding> judge(const std::vector<driver::can::InterfaceFacts>& interfaces, bool can_sockets,
                                         double rate_Hz);

/// The load at `rate_Hz` on a bus of 1 Mbit/s and with CAN FD, for a computer without an interface.
[[nodiscard]] Finding bus_load_finding(double rate_Hz);

/// Findings of the check "hm2": the interface that leads to the board, its ARP entry and coalescing, round trips, and
/// whether somebody else talks to the board. Reads only.
[[nodiscard]] std::vector<Finding> scan_hm2(const driver::hm2::Hm2Options& options);

/// One in `times_us` for each answer; `asked` requests. `foreign`: packets that others sent meanwhile.
[[nodiscard]] Finding judge_round_trips(std::vector<double> times_us, int asked, int foreign);

/// What the kernel's ARP table, as text, has for the address.
[[nodiscard]] Finding judge_arp(const std::string& table, const std::string& address, const std::string& interface);

}  // namespace abs_hil::diagnosis
