#include "config/events.hpp"

#include <fmt/format.h>

#include <array>

#include "config/config_error.hpp"

namespace abs_hil::config {

namespace {

using config::Settings;

constexpr std::array<ChangingPart, 5> parts{{
    {"friction", "friction of the road", [](Settings& s) -> std::string& { return s.plant.friction_profile; }},
    {"brake_torque", "torque of the brake", [](Settings& s) -> std::string& { return s.plant.drift.brake_torque; }},
    {"motor_torque", "torque of the motor", [](Settings& s) -> std::string& { return s.plant.drift.motor_torque; }},
    {"upper_bearing", "friction of the upper wheel's bearing",
     [](Settings& s) -> std::string& { return s.plant.drift.upper_bearing; }},
    {"lower_bearing", "friction of the lower wheel's bearing",
     [](Settings& s) -> std::string& { return s.plant.drift.lower_bearing; }},
}};

[[noreturn]] void refuse(const Script& script, const EventScript& event, std::string_view what,
                         const std::string& problem) {
  throw config::ConfigError(fmt::format("{}: this change of {} {}", script.at(event.place), what, problem));
}

/// Refuses changes of one part that overlap, or that count from different times.
void check_order(const Script& script, const EventScript& before, const EventScript& event, std::string_view what) {
  if (event.from_braking != before.from_braking) {
    refuse(script, event, what,
           fmt::format("counts from {}, but the change in line {} does not; count both from the same time",
                       event.from_braking ? "braking" : "the start", before.place.line));
  }
  if (event.at_s < before.end_s) {
    refuse(
        script, event, what,
        fmt::format("begins at {} s, before the change in line {} ends (at {} s); put them in order, without overlap",
                    event.at_s, before.place.line, before.end_s));
  }
  // A jump may follow a ramp at the ramp's end. At the time of another jump it would undo that one.
  if (event.at_s == before.at_s && event.at_s == event.end_s) {
    refuse(script, event, what,
           fmt::format("comes at {} s, as the change in line {} does; leave one of them out", event.at_s,
                       before.place.line));
  }
}

}  // namespace

std::span<const ChangingPart> changing_parts() noexcept { return parts; }

std::string profile(const Script& script, std::string_view what) {
  std::string text;
  const EventScript* before = nullptr;
  for (const EventScript& event : script.events) {
    for (const Change& change : event.changes) {
      if (change.what != what) continue;
      const bool jump = event.at_s == event.end_s;
      if (before != nullptr) {
        check_order(script, *before, event, what);
      } else {
        // A jump at 0 changes nothing during the run: its factor holds from the start.
        const bool from_the_start = jump && event.at_s == 0.0;
        text =
            fmt::format("{}: {}", event.from_braking ? "braking time" : "time", from_the_start ? change.factor : 1.0);
        if (from_the_start) {
          before = &event;
          continue;
        }
      }
      text += jump ? fmt::format("; {} at {}", change.factor, event.at_s)
                   : fmt::format("; {} from {} to {}", change.factor, event.at_s, event.end_s);
      before = &event;
    }
  }
  return text;
}

}  // namespace abs_hil::config
