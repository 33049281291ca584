// The driver's lifecycle: options, handshake with the node, commands. Its entry in the registry and what it tells
// people.

#include "driver/can/can_driver.hpp"

#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::can {

using rig::formatted;

namespace {

/// In lock-step the emulator may take its time to answer, because the emulated time does not advance meanwhile.
constexpr std::int64_t lock_step_timeout_ns = 1'000'000'000;
/// Share of the period to wait for an answer. The controller and the command need the rest.
constexpr double answer_share = 0.6;

std::int64_t answer_timeout_of(const CanOptions& options, bool lock_step) {
  if (!lock_step) return answer_timeout_ns("driver.can.", options, answer_share);
  return options.answer_timeout_us > 0 ? options.answer_timeout_us * rig::ns_per_us : lock_step_timeout_ns;
}

std::unique_ptr<RigDriver> make_can_driver(const CanOptions& options, const RunFacts& run) {
  CanOptions can = options;
  can.encoder_counts_per_rev = run.encoder_counts_per_rev;
  can.rate_Hz = run.rate_Hz;
  return std::make_unique<CanDriver>(
      can, [can] { return open_link(can); }, run.lock_step);
}

std::unique_ptr<SafeStateWriter> make_can_writer(const CanOptions& options, const RunFacts& /*run*/) {
  const std::string prefix(unix_prefix);
  const bool socket = options.interface.starts_with(prefix);
  const std::string file = socket ? options.interface.substr(prefix.size()) : "/sys/class/net/" + options.interface;
  return safe_state_writer(
      [options, again = Reopening{file}]() mutable { return again.due() ? open_link(options, false) : Link{}; },
      socket);
}

bool is_virtual(const std::string& interface) {
  try {
    const std::optional<InterfaceFacts> facts = find_interface(interface);
    return facts && (facts->kind == "vcan" || facts->kind == "vxcan");
  } catch (const Unavailable&) {
    return false;
  }
}

/// A network interface with a device behind it is an adapter, and a serial line may have an adapter behind it as well.
/// Only vcan, vxcan and a socket in place of a bus are known to have none.
BoardReality can_reality(const CanOptions& options) {
  if (options.interface.starts_with(unix_prefix)) return {.reality = Reality::emulator};
  std::error_code ignored;
  if (std::filesystem::exists("/sys/class/net/" + options.interface + "/device", ignored)) {
    return {.reality = Reality::hardware,
            .option = "driver.can.interface = " + options.interface,
            .is = "is an adapter to a real bus; give a vcan interface or an emulator's socket"};
  }
  return {.reality = is_virtual(options.interface) ? Reality::emulator : Reality::unknown};
}

/// The node's watchdog is what ends its outputs if this computer dies.
void refuse_long_watchdog(const CanOptions& options, const RunFacts& run) {
  constexpr std::int32_t longest_ms = 50;
  if (!run.hardware || run.outputs_on_after_death || options.watchdog_ms <= longest_ms) return;
  throw std::invalid_argument("driver.can.watchdog_ms = " + std::to_string(options.watchdog_ms) +
                              ": motor and brake would stay on for so long after this computer's death; give at most " +
                              std::to_string(longest_ms) +
                              " ms, or accept the risk with --set unsafe.outputs_on_after_death=true");
}

std::string load_text(double rate_Hz, double bit_rate, double data_bit_rate, bool fd) {
  const BusLoad load = bus_load(rate_Hz, bit_rate, data_bit_rate, fd);
  return formatted("bus load at most %.1f %% at %.0f cycles a second and %.0f bit/s; answer within %.0f us of the SYNC",
                   100.0 * load.share, rate_Hz, bit_rate, 1e6 * load.answer_s);
}

}  // namespace

CanDriver::CanDriver(const CanOptions& options, OpenLink open_link, bool lock_step)
    : BoardDriver(output_grid(options)),
      options_(options),
      open_link_(std::move(open_link)),
      lock_step_(lock_step),
      answer_timeout_ns_(answer_timeout_of(options, lock_step)),
      bucket_(options.loss_cost, options.loss_relief, options.loss_limit) {
  check_options("driver.can.", options);
}

Frame CanDriver::in_format(Frame frame) const noexcept {
  frame.fd = fd_;
  return frame;
}

template <class Heard>
bool CanDriver::await(Heard heard) noexcept {
  return link_.socket->listen(monotonic_ns() + handshake_timeout_ns, [&heard](const Frame& frame) {
    const Decoded decoded = decode(frame);
    return decoded.error == DecodeError::none && heard(decoded);
  });
}

bool CanDriver::await_state(NodeState wanted) noexcept {
  bool state = false;
  bool zero = false;
  return await([&](const Decoded& heard) {
    if (heard.id == id::status) state = heard.values.state() == wanted;
    if (heard.id == id::outputs) zero = !heard.values.any_duty();
    if (wanted == NodeState::active && (heard.id == id::status || heard.id == id::outputs)) take_values(heard);
    return state && zero;
  });
}

void CanDriver::identify() {
  for (int attempt = 0; attempt < handshake_attempts; ++attempt) {
    static_cast<void>(link_.socket->send(control_frame(Request::identify)));
    if (await([this](const Decoded& heard) {
          if (heard.id == id::identity) identity_ = heard.values;
          return heard.id == id::identity;
        })) {
      return;
    }
  }
  throw Unavailable("backend rig: " + link_.place +
                    ": no node answers; check the node's power, its bit rate and the bus termination (docs/can.md)");
}

void CanDriver::do_configure() {
  link_ = {};
  counters_ = {};
  link_ = open_link_();
  identify();
  const std::string node = "backend rig: the node on " + link_.place;
  if (identity_.protocol != protocol_version) {
    throw Unavailable(node + " has protocol version " + std::to_string(identity_.protocol) + ", this program needs " +
                      std::to_string(protocol_version) + ": update the node's firmware (docs/can.md)");
  }
  const bool waits_for_lock_step = (identity_.features & feature::lock_step) != 0;
  require_lock_step("the node on " + link_.place, lock_step_, waits_for_lock_step);
  const bool node_can_fd = (identity_.features & feature::can_fd) != 0;
  if (options_.fd == "on" && !node_can_fd) {
    throw Unavailable(node + " does not support CAN FD (driver.can.fd=on): set driver.can.fd=auto");
  }
  fd_ = options_.fd == "on" || (options_.fd == "auto" && link_.can_fd && node_can_fd);
  if (!link_.facts || link_.facts->bit_rate == 0) return;
  const BusLoad load = bus_load(options_.rate_Hz, link_.facts->bit_rate, link_.facts->data_bit_rate, fd_);
  if (load.share > 1.0) {
    throw Unavailable("backend rig: " + link_.place + " at " + std::to_string(link_.facts->bit_rate) +
                      " bit/s cannot carry " + std::to_string(static_cast<int>(options_.rate_Hz)) +
                      " cycles a second (worst-case load " +
                      std::to_string(static_cast<int>(std::ceil(100 * load.share))) +
                      " %): raise the bit rate, use CAN FD or lower --rate");
  }
}

IoResult CanDriver::activate_node() noexcept {
  const Frame activation = frame_of(id::control, {.request = static_cast<int>(Request::activate),
                                                  .nonce = identity_.nonce,
                                                  .watchdog_ms = options_.watchdog_ms,
                                                  .sequence = command_sequence_});
  if (const IoResult result = sent(link_.socket->send(activation)); !result.ok()) return result;
  if (await_state(NodeState::active)) return {};
  return {IoError::no_answer, id::control, 0, rig::Reason::can_node_silent};
}

void CanDriver::do_activate(std::int64_t now_ns) {
  link_.socket->drain();
  identify();  // each activation needs a new nonce
  bucket_.reset();
  tracker_.reset(sync_);
  commanded_ = {};
  command_sent_ = {};
  outputs_known_ = any_answer_ = false;
  raw_counts_ = {};
  counts_ = {};
  trip_flags_ = 0;
  answers_since_status_ = answers_since_outputs_ = 0;
  supply_V_ = temperature_C_ = rig::unknown;
  drops_seen_ = link_.socket->dropped();
  IoResult result = activate_node();
  for (int attempt = 0; result.ok() && !any_answer_ && attempt < handshake_attempts; ++attempt) {
    result = exchange(now_ns);
  }
  if (result.ok() && !any_answer_) result = {IoError::no_answer, id::latch, 0, rig::Reason::can_node_silent};
  if (!result.ok()) {
    static_cast<void>(do_make_safe());
    std::string why = error_text(result);
    if (result.reason != rig::Reason::none) why = std::string(rig::description(result.reason)) + "; " + why;
    throw Unavailable("backend rig: the node on " + link_.place + " could not be activated: " + why);
  }
  bucket_.reset();
}

IoResult CanDriver::sent(const IoResult& result) noexcept {
  if (result.error != IoError::no_answer) return result;
  note(Anomaly::queue_full);
  return {};
}

IoResult CanDriver::do_write(const rig::Command& command, rig::Command& went_out) noexcept {
  if (!driver::in_range(command)) return {IoError::command_out_of_range};
  const IoResult sending =
      send_command({.brake = grid_.brake_width(command), .drive = grid_.motor_width(command)}, command.motor_enable);
  if (sending.ok()) command_sent_ = grid_.as_sent(command);
  went_out = command_sent_;
  const IoResult result = sent(sending);
  return result.ok() && bucket_.tripped() ? tripped() : result;
}

IoResult CanDriver::send_command(const Duties& duties, bool drive_enable) noexcept {
  commanded_[++command_sequence_] = duties;
  return link_.socket->send(in_format(frame_of(id::command, {.brake_duty = duties.brake,
                                                             .drive_duty = duties.drive,
                                                             .drive_enable = drive_enable ? 1 : 0,
                                                             .heartbeat = tracker_.last_sequence(),
                                                             .sequence = command_sequence_})));
}

IoResult CanDriver::deactivate_node() noexcept {
  const IoResult result = link_.socket->send(control_frame(Request::deactivate));
  if (result.error == IoError::disconnected) return {result.error, id::control, result.errno_value};
  if (await_state(NodeState::inactive)) return {};
  return {IoError::no_answer, id::control};
}

BoardIdentity CanDriver::identity() const {
  if (!link_.socket) return {};
  return {.place = options_.interface, .logic = "protocol " + std::to_string(identity_.protocol)};
}

bool CanDriver::outputs_now(rig::Command& applied) noexcept {
  if (!link_.socket) return false;
  link_.socket->drain();
  return send_sync(monotonic_ns()).ok() && await([&applied](const Decoded& heard) {
           const auto width = [](std::int64_t duty) { return static_cast<std::uint32_t>(duty); };
           applied = command_shown(width(heard.values.drive_duty), width(heard.values.brake_duty), duty_steps);
           return heard.id == id::outputs || heard.id == id::measurement;
         });
}

IoResult CanDriver::do_make_safe() noexcept {
  if (!link_.socket) return {IoError::disconnected};
  link_.socket->drain();  // earlier frames must not count as the answer
  IoResult result{};
  for (int attempt = 0; attempt < handshake_attempts; ++attempt) {
    static_cast<void>(send_command({}, false));
    result = deactivate_node();
    if (result.ok()) return {};
  }
  return result;
}

Backend can_backend() {
  return backend<CanOptions>({
      .name = "can",
      .summary = "CAN I/O node of this project's own protocol (docs/can.md); unverified on hardware",
      .not_verified =
          "The protocol is this project's own (docs/can.md) and has been tested only with an emulated node. Do the "
          "checks of docs/can.md, \"What is not verified\"",
      .make_driver = make_can_driver,
      .make_safe_state_writer = make_can_writer,
      .outputs = output_grid,
      .reality = can_reality,
      .inspect = inspect,
      .check = refuse_long_watchdog,
      .free_options = {"interface", "fd", "answer_timeout_us", "loss_cost", "loss_relief", "loss_limit",
                       "plausible_speed_rad_s"},
  });
}

std::vector<std::string> CanDriver::notes() const {
  if (!link_.socket) return {};
  std::vector<std::string> notes;
  notes.push_back(formatted(
      "%s: node with protocol %u answers%s; %s frames", link_.place.c_str(), static_cast<unsigned>(identity_.protocol),
      (identity_.features & feature::lock_step) != 0 ? ", an emulator in lock-step" : "", fd_ ? "CAN FD" : "classic"));
  if (const auto& facts = link_.facts; facts && facts->bit_rate > 0) {
    notes.push_back(load_text(options_.rate_Hz, static_cast<double>(facts->bit_rate),
                              static_cast<double>(facts->data_bit_rate), fd_));
  } else {
    constexpr double megabit = 1e6;
    notes.push_back("the interface has no bit rate; on a real bus: " +
                    load_text(options_.rate_Hz, megabit, fd_ ? 5 * megabit : 0.0, fd_));
  }
  notes.push_back(
      formatted("the node zeroes its outputs %d ms after the last valid command; each loss adds %d points, each good "
                "answer takes off %d, and the run ends at %d points",
                options_.watchdog_ms, options_.loss_cost, options_.loss_relief, options_.loss_limit));
  return notes;
}

std::vector<std::string> CanDriver::tally() const {
  const CanCounters& c = counters_;
  const auto counts = [](std::initializer_list<std::pair<std::uint64_t, const char*>> all) {
    std::string text;
    for (const auto& [count, what] : all) text += (text.empty() ? "" : ", ") + std::to_string(count) + what;
    return text;
  };
  std::vector<std::string> lines{
      "CAN: " + counts({{c.cycles, " cycles"}, {c.of(Anomaly::missing), " without an answer in time"}}) +
      formatted("; longest answer %.0f us", static_cast<double>(c.longest_answer_ns) * 1e-3)};
  const std::uint64_t odd = std::accumulate(c.anomalies.begin(), c.anomalies.end(), std::uint64_t{0}) -
                            c.of(Anomaly::missing) - c.of(Anomaly::too_many) + c.error_frames + c.dropped_by_kernel +
                            c.rejected_by_node;
  if (odd == 0) return lines;
  lines.push_back("CAN frames: " + counts({{c.of(Anomaly::stale), " stale"},
                                           {c.of(Anomaly::duplicate), " duplicate"},
                                           {c.of(Anomaly::out_of_order), " out of order"},
                                           {c.of(Anomaly::wrong_length), " of wrong length"},
                                           {c.of(Anomaly::forged), " forged"},
                                           {c.of(Anomaly::implausible), " implausible"},
                                           {c.dropped_by_kernel, " dropped by the kernel"}}));
  lines.push_back("CAN bus: " + counts({{c.of(Anomaly::queue_full), " times the send queue was full"},
                                        {c.error_frames, " error frames"},
                                        {c.error_warnings, " of them warnings"},
                                        {c.rejected_by_node, " commands rejected by the node"}}));
  return lines;
}

std::vector<std::string> CanDriver::inspection() {
  if (!link_.socket) return {};
  std::vector<std::string> lines = notes();
  link_.socket->drain();
  tracker_.reset(sync_);
  // An inactive node answers a SYNC, too, and the SYNC moves nothing.
  tracker_.expect(++sync_);
  static_cast<void>(link_.socket->send(frame_of(id::sync, {.sequence = sync_})));
  sent_ns_ = monotonic_ns();
  static_cast<void>(collect());
  if (!tracker_.complete()) {
    lines.emplace_back("no answer to a SYNC");
    return lines;
  }
  const Values& answer = tracker_.answer().values;
  lines.push_back(formatted("counters: upper wheel %d, lower wheel %d, lever %d", static_cast<int>(answer.upper_counts),
                            static_cast<int>(answer.lower_counts), static_cast<int>(answer.lever_counts)));
  lines.push_back(formatted("node's clock %.6f s, state %s", 1e-6 * static_cast<double>(answer.node_time_us),
                            answer.state() == NodeState::inactive ? "inactive"
                            : answer.state() == NodeState::active ? "active"
                                                                  : "latched"));
  lines.push_back(formatted("supply %.2f V, temperature %.1f deg C, trip flags 0x%x (NaN: not received yet)", supply_V_,
                            temperature_C_, trip_flags_));
  return lines;
}

}  // namespace abs_hil::driver::can
