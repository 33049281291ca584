/* The gate's decision: what of a wanted command may be sent now. C99 without heap, I/O and loops, so that CBMC proves what
   docs/safety.md says of it (tests/proofs/gate.toml). CommandGate calls it, latches the faults, and counts the actions. */
#ifndef ABS_HIL_RUNTIME_GATE_CORE_H
#define ABS_HIL_RUNTIME_GATE_CORE_H

#include <stdbool.h>
#include <stdint.h>

/* As rig::GateAction. */
enum {
  GATE_PASSED,
  GATE_MOTOR_CLAMPED,
  GATE_BRAKE_CLAMPED,
  GATE_MOTOR_BY_BRAKE,
  GATE_MOTOR_BY_DISABLE,
  GATE_REFUSED,
  GATE_MOTOR_RATE,
  GATE_BRAKE_RATE,
  GATE_MOTOR_BY_PHASE,
  GATE_BRAKE_BY_PHASE
};

/* A driver may round a duty down by so much: half a step of 8 bits, the coarsest PWM. */
static const double gate_rounded_down_most = 0.5 / 255.0;
/* Tolerance for rounding: a step exactly at the limit must pass. */
static const double gate_rise_rounding = 1e-9;

struct gate_command {
  double motor_duty, brake_duty;
  bool motor_enable;
  double brake_torque_Nm;
};
/* What a phase allows; `together`: motor and brake at once. */
struct gate_permission {
  bool motor, brake, together;
};
/* Of a run. What is sendable passes at most, so that no rounding exceeds the limits; to lower a duty to it is no action.
   A rise of the brake begins at the free duty, below which it gives no torque. */
struct gate_limits {
  double motor_duty_max, brake_duty_max, motor_sendable, brake_sendable;
  double motor_rate_per_s, brake_rate_per_s, brake_free_duty;
  double fault_brake_duty, fault_brake_limit_s;
};
struct gate_state {
  double motor_risen, brake_risen; /* duties from which the next rise counts */
  int64_t sent_ns, fault_ns;       /* of the last command, and of the first after a fault */
  bool has_sent, has_failed;
};
/* Without a fault the command is finite: anything else is one. */
struct gate_wish {
  struct gate_command command;
  struct gate_permission may;
  bool faulty, brake_barred; /* by a fault */
  int64_t now_ns;
};
/* What has been done to a command: all of it as bits, and the last; 0: it has passed. */
struct gate_deeds {
  uint32_t bits, last;
};

static inline double gate_least(double a, double b) { return b < a ? b : a; }
static inline double gate_most(double a, double b) { return a < b ? b : a; }
static inline double gate_seconds(int64_t ns) { return (double)ns * 1e-9; }

static inline bool gate_brakes(const struct gate_command *command) {
  return command->brake_duty > 0.0 || command->brake_torque_Nm > 0.0;
}

static inline void gate_note(struct gate_deeds *deeds, uint32_t action) {
  deeds->bits |= 1U << action;
  deeds->last = action;
}

static inline double gate_limited(double duty, double most, double sendable, uint32_t action, struct gate_deeds *deeds) {
  const double within = duty < 0.0 ? 0.0 : most < duty ? most : duty;
  if (within != duty) gate_note(deeds, action);
  return gate_least(within, sendable);
}

/* A clock that goes back gives no time. */
static inline double gate_highest(double before, double rate_per_s, double elapsed_s) {
  return before + rate_per_s * gate_most(0.0, elapsed_s);
}

static inline double gate_rising(double duty, double highest, uint32_t action, struct gate_deeds *deeds) {
  if (duty <= highest + gate_rise_rounding) return duty;
  gate_note(deeds, action);
  return highest;
}

static inline bool gate_held_too_long(const struct gate_limits *limits, const struct gate_state *state, int64_t now_ns) {
  return gate_seconds(now_ns - state->fault_ns) > limits->fault_brake_limit_s;
}

/* The command that may follow a fault: the motor is off, and the brake holds at most fault_brake_duty, if no fault bars it
   and the logic wants it. */
static inline struct gate_command gate_after_fault(const struct gate_limits *limits, struct gate_state *state,
                                                   const struct gate_wish *wish) {
  struct gate_command command = {0.0, 0.0, false, 0.0};
  const double torque_Nm = wish->command.brake_torque_Nm;
  if (!state->has_failed) state->fault_ns = wish->now_ns;
  state->has_failed = true;
  const double duty = gate_least(wish->command.brake_duty, limits->fault_brake_duty);
  const bool holds = duty > 0.0 && torque_Nm - torque_Nm == 0.0; /* false for NaN and infinity */
  if (!holds || wish->brake_barred || gate_held_too_long(limits, state, wish->now_ns)) return command;
  command.brake_duty = duty;
  command.brake_torque_Nm = torque_Nm * (duty / wish->command.brake_duty);
  return command;
}

static inline void gate_stop_motor(struct gate_command *command, uint32_t action, struct gate_deeds *deeds) {
  command->motor_duty = 0.0;
  command->motor_enable = false;
  gate_note(deeds, action);
}

static inline void gate_interlock(struct gate_command *command, const struct gate_permission *may, struct gate_deeds *deeds) {
  if (command->motor_duty > 0.0 && !command->motor_enable) gate_stop_motor(command, GATE_MOTOR_BY_DISABLE, deeds);
  if (command->motor_duty > 0.0 && !may->motor) gate_stop_motor(command, GATE_MOTOR_BY_PHASE, deeds);
  if (gate_brakes(command) && !may->brake) {
    command->brake_duty = command->brake_torque_Nm = 0.0;
    gate_note(deeds, GATE_BRAKE_BY_PHASE);
  }
  if (command->motor_duty > 0.0 && gate_brakes(command) && !may->together)
    gate_stop_motor(command, GATE_MOTOR_BY_BRAKE, deeds);
}

static inline struct gate_command gate_decide(const struct gate_limits *limits, struct gate_state *state,
                                              const struct gate_wish *wish, struct gate_deeds *deeds) {
  struct gate_command command = wish->faulty ? gate_after_fault(limits, state, wish) : wish->command;
  deeds->bits = deeds->last = 0;
  if (!wish->faulty || gate_brakes(&command)) {
    command.brake_torque_Nm = gate_most(0.0, command.brake_torque_Nm);
    command.brake_duty =
      gate_limited(command.brake_duty, limits->brake_duty_max, limits->brake_sendable, GATE_BRAKE_CLAMPED, deeds);
    command.motor_duty =
      gate_limited(command.motor_duty, limits->motor_duty_max, limits->motor_sendable, GATE_MOTOR_CLAMPED, deeds);
    /* The first command may rise at once: the outputs have been 0 for longer than any rise takes. */
    if (state->has_sent) {
      const double elapsed_s = gate_seconds(wish->now_ns - state->sent_ns);
      const double from = gate_most(state->brake_risen, limits->brake_free_duty);
      command.brake_duty = gate_rising(command.brake_duty, gate_highest(from, limits->brake_rate_per_s, elapsed_s),
                                       GATE_BRAKE_RATE, deeds);
      command.motor_duty =
        gate_rising(command.motor_duty, gate_highest(state->motor_risen, limits->motor_rate_per_s, elapsed_s),
                    GATE_MOTOR_RATE, deeds);
    }
    gate_interlock(&command, &wish->may, deeds);
  }
  if (wish->faulty) gate_note(deeds, GATE_REFUSED);
  state->brake_risen = command.brake_duty;
  state->motor_risen = command.motor_duty;
  state->sent_ns = wish->now_ns;
  state->has_sent = true;
  return command;
}

/* A rise goes on from the unrounded duty: steps of the PWM must not swallow a slow one. If the driver sent much less, the
   rise goes on from that. */
static inline void gate_note_sent(struct gate_state *state, double motor_duty, double brake_duty) {
  state->brake_risen = gate_least(state->brake_risen, brake_duty + gate_rounded_down_most);
  state->motor_risen = gate_least(state->motor_risen, motor_duty + gate_rounded_down_most);
}

#endif
