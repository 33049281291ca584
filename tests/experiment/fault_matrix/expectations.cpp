// Expected result of each fault: the classes and bounds of docs/safety.md, "What is found, and how soon".

#include <utility>

#include "matrix.hpp"

namespace abs_hil::experiment::test {

namespace {

using config::InjectionKind;
using config::InjectionSignal;
using rig::Phase;
using rig::Reason;

constexpr double at_once_s = 0.002;    ///< board flags, I/O errors, leaping counters
constexpr double missing_s = 0.025;    ///< no fresh measurement
constexpr double overruns_s = 0.160;   ///< 50 late cycles of 3 ms
constexpr double encoder_s = 0.25;     ///< an encoder that does not follow its wheel, from rest too
constexpr double lost_counts_s = 0.5;  ///< an encoder that follows its wheel intermittently
constexpr double response_s = 0.5;     ///< an output that does not follow its command
constexpr double held_s = 0.7;         ///< a brake that holds on: until the wheel has locked, and a quarter second
constexpr double random_s = 5.0;       ///< random outputs: until they contradict the command
constexpr double half_motor_s = 20.0;  ///< a motor at half duty still works; other effects show in braking

bool before(Phase phase, Phase other) { return static_cast<int>(phase) < static_cast<int>(other); }

Expectation encoder(const config::Injection& injection, Reason stuck, Reason jumped, Reason reversed) {
  // A few turns per second at the end: too slow to detect stuck and reversed before the run ends.
  const bool slow_wheels = !before(*injection.phase, Phase::hold);
  switch (injection.kind) {
    case InjectionKind::off:
      return {{stuck, jumped, Reason::encoders_lost, Reason::motor_no_response}, false, encoder_s};
    case InjectionKind::stuck:
    case InjectionKind::slow:
      return {{stuck, jumped, Reason::encoders_lost, Reason::encoders_disagree, Reason::motor_no_response,
               Reason::encoder_lower_stuck},
              slow_wheels,
              response_s};
    case InjectionKind::garbage: return {{jumped}, false, at_once_s};
    case InjectionKind::wrong: return {{reversed, jumped}, slow_wheels, encoder_s};
    case InjectionKind::delayed:
      // From rest the only effect is a longer stop; at speed the counter stands at first.
      return {{stuck, Reason::encoders_lost, Reason::encoder_lower_stuck},
              slow_wheels || before(*injection.phase, Phase::coast),
              encoder_s};
    case InjectionKind::intermittent:
      return {{stuck, jumped, Reason::encoders_disagree, Reason::encoders_lost, Reason::encoder_lower_stuck,
               Reason::encoder_lower_jumped},
              slow_wheels,
              lost_counts_s};
    case InjectionKind::ok: break;
  }
  return {{}, true};
}

Expectation both_encoders(const config::Injection& injection) {
  Expectation expectation =
      encoder(injection, Reason::encoders_lost, Reason::encoder_upper_jumped, Reason::encoder_lower_jumped);
  if (injection.kind == InjectionKind::wrong) {
    // Swapped wheels that roll on each other show equal speeds; braking reveals them.
    expectation.reasons.push_back(Reason::slip_implausible);
    expectation.bound_s = before(*injection.phase, Phase::brake) ? 10.0 : encoder_s;
  }
  return expectation;
}

Expectation stamp(InjectionKind kind) {
  // Good stamps in between are enough to continue.
  if (kind == InjectionKind::intermittent) return {{Reason::samples_missing}, true, missing_s};
  return {{Reason::samples_missing}, kind == InjectionKind::ok, missing_s};
}

/// What the board reports about itself; what the simulator does not report cannot be wrong or late.
Expectation supply(Backend backend, InjectionKind kind) {
  const bool shows = kind == InjectionKind::garbage || kind == InjectionKind::off ||
                     kind == InjectionKind::intermittent ||
                     (kind == InjectionKind::wrong && backend == Backend::card);  // half of 24 V
  return {{Reason::board_supply_low}, !shows, kind == InjectionKind::intermittent ? 0.03 : at_once_s};
}

Expectation temperature(Backend backend, InjectionKind kind) {
  const bool told = backend == Backend::card;
  switch (kind) {
    case InjectionKind::garbage: return {{Reason::board_too_hot}, false, 0.03};
    case InjectionKind::wrong: return {{Reason::board_too_hot}, !told, at_once_s};  // by 100 K
    case InjectionKind::off: return {{Reason::board_health_lost}, !told, at_once_s};
    case InjectionKind::intermittent: return {{Reason::board_health_lost}, !told, 0.03};
    default: return {{}, true};
  }
}

Expectation trip(InjectionKind kind) {
  const bool shows =
      kind == InjectionKind::garbage || kind == InjectionKind::wrong || kind == InjectionKind::intermittent;
  return {{Reason::board_interlock_tripped, Reason::board_supply_tripped}, !shows, 0.03};
}

Expectation read(InjectionKind kind) {
  switch (kind) {
    case InjectionKind::off:
    case InjectionKind::wrong: return {{Reason::driver_read_failed}, false, at_once_s};
    case InjectionKind::intermittent: return {{Reason::driver_read_failed}, false, 0.03};
    case InjectionKind::stuck:
    case InjectionKind::delayed: return {{Reason::samples_missing}, false, missing_s};
    case InjectionKind::slow: return {{Reason::consecutive_overruns}, false, overruns_s};
    case InjectionKind::garbage:
      return {{Reason::board_interlock_tripped, Reason::board_supply_tripped, Reason::board_supply_low,
               Reason::samples_missing},
              false,
              at_once_s};
    case InjectionKind::ok: break;
  }
  return {{}, true};
}

/// Drive PWM and enable: both have the same effect on the wheels.
Expectation drive(const config::Injection& injection) {
  const bool driven = before(*injection.phase, Phase::coast);
  switch (injection.kind) {
    case InjectionKind::off: return {{Reason::motor_no_response}, !driven, response_s};
    case InjectionKind::stuck:
      // Stuck at its duty: correct during acceleration, and the enable switches it off afterwards.
      return {{Reason::motor_no_response}, injection.phase != Phase::idle, response_s};
    case InjectionKind::wrong:
      return {{Reason::motor_no_response}, injection.signal == InjectionSignal::motor_pwm || !driven, response_s};
    default: return {{Reason::motor_no_response}, true, half_motor_s};
  }
}

Expectation brake(const config::Injection& injection) {
  const bool late = injection.phase == Phase::hold || injection.phase == Phase::stopped;
  switch (injection.kind) {
    case InjectionKind::off:
    case InjectionKind::wrong: return {{Reason::brake_no_response}, late, response_s};
    case InjectionKind::stuck:
      // From the start of braking it stays on: the wheel locks, and stands although the controller releases the brake.
      return {{Reason::brake_no_response, Reason::released_wheel_stands}, late, held_s};
    case InjectionKind::garbage:
      return {{Reason::brake_no_response, Reason::motor_no_response, Reason::encoder_upper_stuck,
               Reason::released_wheel_stands, Reason::encoders_disagree},
              !before(*injection.phase, Phase::coast),
              random_s};
    default: return {{Reason::brake_no_response}, true, response_s};
  }
}

Expectation write(Backend backend, const config::Injection& injection) {
  const bool late = injection.phase == Phase::hold || injection.phase == Phase::stopped;
  switch (injection.kind) {
    case InjectionKind::off: return {{Reason::driver_write_failed}, false, at_once_s};
    case InjectionKind::intermittent: return {{Reason::driver_write_failed}, false, 0.03};
    case InjectionKind::slow: return {{Reason::consecutive_overruns}, false, overruns_s};
    case InjectionKind::stuck:
      return {{Reason::motor_no_response, Reason::brake_no_response, Reason::speed_rises_with_motor_off,
               Reason::released_wheel_stands},
              late,
              held_s};
    case InjectionKind::wrong:
      return {{Reason::brake_no_response}, late, before(*injection.phase, Phase::coast) ? half_motor_s : response_s};
    case InjectionKind::garbage:
      return {{Reason::motor_no_response, Reason::brake_no_response, Reason::speed_rises_with_motor_off,
               Reason::encoder_upper_stuck, Reason::released_wheel_stands, Reason::encoders_disagree},
              // Capped at 0.7 as on the boards, a random brake acts roughly like the commanded one.
              late || (is_board(backend) && !before(*injection.phase, Phase::coast)),
              random_s};
    default: return {{Reason::brake_no_response}, true, response_s};
  }
}

/// The measured rig's motor starts through a resistor, with 0.9 N m instead of 2.1: until the wheels are fast enough
/// for a check takes up to 2.4 times as long, and counts that are lost or late can look like a motor without effect.
/// With half the friction a brake that holds on locks the wheel later.
Expectation on_measured(Expectation expectation, const config::Injection& injection) {
  const bool of_encoders = injection.signal == InjectionSignal::encoder_upper ||
                           injection.signal == InjectionSignal::encoder_lower ||
                           injection.signal == InjectionSignal::encoders;
  if (of_encoders && before(*injection.phase, Phase::coast)) expectation.bound_s *= 2.4;
  if (injection.signal == InjectionSignal::encoders) {
    expectation.reasons.push_back(Reason::motor_no_response);
    expectation.reasons.push_back(Reason::encoder_lower_jumped);
  }
  if (expectation.bound_s == held_s) expectation.bound_s = 1.2;
  return expectation;
}

Expectation expected_of(Backend backend, const config::Injection& injection) {
  switch (injection.signal) {
    case InjectionSignal::encoder_upper:
      return encoder(injection, Reason::encoder_upper_stuck, Reason::encoder_upper_jumped,
                     Reason::encoder_upper_reversed);
    case InjectionSignal::encoder_lower:
      return encoder(injection, Reason::encoder_lower_stuck, Reason::encoder_lower_jumped,
                     Reason::encoder_lower_reversed);
    case InjectionSignal::encoders: return both_encoders(injection);
    case InjectionSignal::stamp: return stamp(injection.kind);
    case InjectionSignal::supply: return supply(backend, injection.kind);
    case InjectionSignal::temperature: return temperature(backend, injection.kind);
    case InjectionSignal::trip: return trip(injection.kind);
    case InjectionSignal::read: return read(injection.kind);
    case InjectionSignal::motor_pwm:
    case InjectionSignal::enable: return drive(injection);
    case InjectionSignal::brake_pwm: return brake(injection);
    case InjectionSignal::write: return write(backend, injection);
  }
  return {};
}

}  // namespace

Expectation expected(Backend backend, const config::Injection& injection) {
  Expectation expectation = expected_of(backend, injection);
  return backend == Backend::measured_step || backend == Backend::measured_relay
             ? on_measured(std::move(expectation), injection)
             : expectation;
}

}  // namespace abs_hil::experiment::test
