#include "driver/can/protocol.hpp"

#include <array>

namespace abs_hil::driver::can {

namespace {

namespace s = signal;

constexpr std::array time_signals{s::host_time, s::check_of_8};
constexpr std::array sync_signals{s::sync_sequence, s::sync_check};
constexpr std::array command_signals{s::brake_duty, s::drive_duty,    s::drive_enable,
                                     s::heartbeat,  s::sequence_of_8, s::check_of_8};
constexpr std::array control_signals{s::request, s::control_nonce, s::watchdog_timeout, s::sequence_of_8,
                                     s::check_of_8};
constexpr std::array status_signals{s::trip_flags,  s::node_state,    s::latch_reason, s::supply,
                                    s::temperature, s::sequence_of_8, s::check_of_8};
constexpr std::array outputs_signals{s::brake_applied,    s::drive_applied, s::rejected_commands,
                                     s::command_sequence, s::sequence_of_8, s::check_of_8};
constexpr std::array encoders_signals{s::upper_counts, s::lower_counts, s::sequence_of_8, s::check_of_8};
constexpr std::array latch_signals{s::node_time, s::lever_counts, s::latch_state, s::sequence_of_8, s::check_of_8};
constexpr std::array measurement_signals{s::fd_upper_counts, s::fd_lower_counts,  s::fd_lever_counts,
                                         s::fd_node_time,    s::fd_brake_applied, s::fd_drive_applied,
                                         s::fd_trip_flags,   s::fd_node_state,    s::fd_command_sequence,
                                         s::fd_sequence,     s::fd_check};
constexpr std::array identity_signals{s::protocol, s::features, s::identity_nonce, s::identity_watchdog, s::check_of_8};

constexpr std::array table{
    Message{id::time, "ABS_TIME", 8, false, false, time_signals},
    Message{id::sync, "ABS_SYNC", 2, false, false, sync_signals},
    Message{id::command, "ABS_COMMAND", 8, false, false, command_signals},
    Message{id::control, "ABS_CONTROL", 8, false, false, control_signals},
    Message{id::status, "ABS_STATUS", 8, true, false, status_signals},
    Message{id::outputs, "ABS_OUTPUTS", 8, true, false, outputs_signals},
    Message{id::encoders, "ABS_ENCODERS", 8, true, false, encoders_signals},
    Message{id::latch, "ABS_LATCH", 8, true, false, latch_signals},
    Message{id::measurement, "ABS_MEASUREMENT", 24, true, true, measurement_signals},
    Message{id::identity, "ABS_IDENTITY", 8, true, false, identity_signals},
};

}  // namespace

std::span<const Message> messages() noexcept { return table; }

const Message* find_message(std::uint32_t identifier) noexcept {
  for (const Message& message : table) {
    if (message.id == identifier) return &message;
  }
  return nullptr;
}

}  // namespace abs_hil::driver::can
