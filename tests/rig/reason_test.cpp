// The table of reasons: published numbers, values, words.
#include "abs_hil/rig/reason.hpp"

#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "abs_hil/rig/phase.hpp"
#include "catch.hpp"
#include "rig/reason_text.hpp"

using namespace abs_hil::rig;

namespace {

/// Logs contain these numbers. Never change or remove a line. Append a line for a new reason.
// clang-format off
constexpr std::pair<std::string_view, int> published[]{
    {"none", 0},
    {"run_started", 1},
    {"start_speed_given", 2},
    {"speed_threshold_reached", 3},
    {"upper_wheel_peak_detected", 4},
    {"phase_duration_over", 5},
    {"end_speed_reached", 6},
    {"standstill_reached", 7},
    {"sequence_complete", 8},
    {"slip_control_left_at_low_speed", 9},
    {"speed_condition_met", 20},
    {"slip_condition_met", 21},
    {"distance_reached", 22},
    {"all_conditions_met", 23},
    {"interrupt_signal", 32},
    {"terminate_signal", 33},
    {"stop_command", 34},
    {"hangup_signal", 35},
    {"gain_changed", 37},
    {"slip_reference_changed", 38},
    {"start_command", 39},
    {"commands_not_enabled", 40},
    {"command_not_authentic", 41},
    {"command_repeated", 42},
    {"command_unknown", 43},
    {"command_out_of_range", 44},
    {"command_malformed", 45},
    {"command_not_now", 46},
    {"phase_time_limit", 64},
    {"overspeed", 65},
    {"command_not_finite", 66},
    {"estimate_not_finite", 67},
    {"driver_read_failed", 68},
    {"driver_write_failed", 69},
    {"board_interlock_tripped", 70},
    {"consecutive_overruns", 71},
    {"board_supply_tripped", 80},
    {"board_supply_low", 81},
    {"board_too_hot", 82},
    {"foreign_writer", 83},
    {"board_reconfigured", 84},
    {"can_node_silent", 100},
    {"can_frames_stale", 101},
    {"can_frames_duplicated", 102},
    {"can_frames_out_of_order", 103},
    {"can_frame_wrong_length", 104},
    {"can_frames_forged", 105},
    {"can_values_implausible", 106},
    {"can_too_many_frames", 107},
    {"can_send_queue_full", 108},
    {"can_bus_off", 109},
    {"can_error_passive", 110},
    {"can_interface_down", 111},
    {"can_node_latched", 112},
    {"can_node_restarted", 113},
    {"can_outputs_not_taken", 114},
    {"usb_unplugged", 120},
    {"usb_stalled", 121},
    {"usb_short_frame", 122},
    {"usb_no_answer", 123},
    {"usb_not_a_frame", 124},
    {"usb_outputs_not_taken", 125},
    {"usb_transfer_failed", 126},
    {"encoder_upper_stuck", 130},
    {"encoder_lower_stuck", 131},
    {"encoder_upper_jumped", 132},
    {"encoder_lower_jumped", 133},
    {"encoder_upper_reversed", 134},
    {"encoder_lower_reversed", 135},
    {"encoders_lost", 136},
    {"encoders_disagree", 137},
    {"slip_implausible", 138},
    {"samples_missing", 139},
    {"speed_rises_with_motor_off", 140},
    {"motor_no_response", 141},
    {"brake_no_response", 142},
    {"board_health_lost", 143},
    {"guardian_died", 160},
    {"guardian_silent", 161},
    {"controller_died", 162},
    {"controller_silent", 163},
    {"safe_state_unverified", 164},
    {"run_time_limit", 200},
    {"run_distance_limit", 201},
    {"released_wheel_stands", 223},
    {"braking_without_stop", 230},
};
// clang-format on

}  // namespace

TEST_CASE("every published reason keeps its number") {
  for (const auto& [name, number] : published) {
    INFO(name);
    const auto row =
        std::find_if(reasons.begin(), reasons.end(), [name = name](const auto& r) { return r.name == name; });
    REQUIRE(row != reasons.end());
    CHECK(static_cast<int>(row->reason) == number);
  }
}

TEST_CASE("a number without a row says so, and is a fault from 64 on") {
  for (const int number : {10, 36, 63, 72, 199, 202, 65535}) {
    const auto reason = static_cast<Reason>(number);
    CHECK(description(reason) == "unknown reason");
    CHECK(is_fault(reason) == (number >= 64));
    CHECK_FALSE(is_stop_request(reason));
    CHECK_FALSE(is_adjustment(reason));
  }
}

TEST_CASE("a fault's value comes with quantity, unit and bound") {
  CHECK(reason_with_value(Reason::overspeed, 203.14) ==
        "wheel speed above the limit (speed 203.14 rad/s; bound: gate.overspeed_rad_s)");
  CHECK(reason_with_value(Reason::overspeed, 203.14, {}, "200") ==
        "wheel speed above the limit (speed 203.14 rad/s; bound: gate.overspeed_rad_s = 200)");
  CHECK(reason_with_value(Reason::guardian_died, 0.0) == description(Reason::guardian_died));
  for (const ReasonRow& row : reasons) {
    INFO(row.name);
    if (row.value.quantity.empty()) CHECK((row.value.unit.empty() && row.value.bound.empty()));
  }
}

TEST_CASE("every known reason has words of its own") {
  std::set<std::string> seen;
  int known = 0;
  for (std::uint16_t number = 0; number < 256; ++number) {
    const std::string text(description(static_cast<Reason>(number)));
    if (text == "unknown reason") continue;
    ++known;
    seen.insert(text);
  }
  CHECK(known >= 20);
  CHECK(seen.size() == static_cast<std::size_t>(known));
}

TEST_CASE("reasons have three groups: the run goes on, a stop request, a fault") {
  CHECK_FALSE(is_fault(Reason::sequence_complete));
  CHECK_FALSE(is_fault(Reason::interrupt_signal));
  CHECK(is_stop_request(Reason::interrupt_signal));
  CHECK(is_stop_request(Reason::stop_command));
  CHECK_FALSE(is_stop_request(Reason::overspeed));
  CHECK(is_fault(Reason::phase_time_limit));
  CHECK(is_fault(Reason::consecutive_overruns));
}

TEST_CASE("a replay reproduces the reasons that measurements show") {
  CHECK(row_of(Reason::overspeed).found_again == ReplayFinds::yes);
  CHECK(row_of(Reason::encoder_upper_stuck).found_again == ReplayFinds::wheel_checks);
  CHECK(row_of(Reason::encoder_lower_jumped).found_again == ReplayFinds::jumped_counts);
  CHECK(row_of(Reason::can_bus_off).found_again == ReplayFinds::no);
  CHECK(row_of(Reason::stop_command).found_again == ReplayFinds::no);
  CHECK(row_of(static_cast<Reason>(300)).found_again == ReplayFinds::no);
}

TEST_CASE("phases have the names of the CSV") {
  const char* names[] = {"idle", "accelerate", "coast", "brake", "hold", "stopped", "fault"};
  for (std::uint8_t i = 0; i < 7; ++i) CHECK(name_of(static_cast<Phase>(i)) == names[i]);
}
