/* What CBMC is asked of the gate's decision: each property for every double, NaN and infinity among them, every time of 64
   bits, and every state that `holds`, which each call leaves behind again. core.c is src/runtime/gate_core.h. */
#include <math.h> /* isnan */

#include "core.c"

#define ANY(type, name)             \
  static struct type name(void) {   \
    struct type any;                \
    return any;                     \
  }
ANY(gate_state, any_state)
ANY(gate_limits, any_limits)
ANY(gate_wish, any_wish)
ANY(gate_command, any_command)

static bool is_number(double x) { return x - x == 0.0; }
static bool is_within(double x, double least, double most) { return x >= least && x <= most; }

/* The ranges of the options (GateOptions), and what a driver can send. */
static bool are_sound(const struct gate_limits *l) {
  return l->motor_duty_max > 0 && l->motor_duty_max <= 1 && l->brake_duty_max > 0 && l->brake_duty_max <= 1 &&
         is_within(l->motor_sendable, 0, 1) && is_within(l->brake_sendable, 0, 1) && l->motor_rate_per_s > 0 &&
         l->motor_rate_per_s <= 1e6 && l->brake_rate_per_s > 0 && l->brake_rate_per_s <= 1e6 &&
         is_within(l->brake_free_duty, 0, 1) && is_within(l->fault_brake_duty, 0, 1) && l->fault_brake_limit_s > 0 &&
         l->fault_brake_limit_s <= 60;
}

static bool holds(const struct gate_state *s) {
  return is_within(s->motor_risen, 0, 1.01) && is_within(s->brake_risen, 0, 1.01);
}

static bool is_finite(const struct gate_command *c) {
  return is_number(c->motor_duty) && is_number(c->brake_duty) && is_number(c->brake_torque_Nm);
}

static struct gate_limits limits;
static struct gate_state state;
static struct gate_wish wish;
static struct gate_deeds deeds;
static struct gate_command sent;

/* Times lie within 2^62 ns of 0, 146 years: their differences do not overflow. The clock may go back. */
static void assume(void) {
  limits = any_limits();
  state = any_state();
  wish = any_wish();
  const int64_t far = INT64_C(1) << 61;
  __CPROVER_assume(are_sound(&limits) && holds(&state) && wish.now_ns > -far && wish.now_ns < far);
  __CPROVER_assume(state.sent_ns > -far && state.sent_ns < far && state.fault_ns > -far && state.fault_ns < far);
  /* CommandGate latches a fault for anything else (test `gate`). */
  __CPROVER_assume(wish.faulty || is_finite(&wish.command));
}

static void decide(void) {
  assume();
  sent = gate_decide(&limits, &state, &wish, &deeds);
}

#define CLAIM(condition, text) __CPROVER_assert(condition, "CLAIM " text)

void prove_range(void) {
  decide();
  CLAIM(is_within(sent.motor_duty, 0, limits.motor_duty_max) && sent.motor_duty <= limits.motor_sendable,
        "the motor's duty lies within 0 and its cap");
  CLAIM(is_within(sent.brake_duty, 0, limits.brake_duty_max) && sent.brake_duty <= limits.brake_sendable,
        "the brake's duty lies within 0 and its cap");
  CLAIM(holds(&state), "the state holds");
}

void prove_torque(void) {
  decide();
  CLAIM(is_number(sent.brake_torque_Nm) && sent.brake_torque_Nm >= 0, "the torque is finite and not negative");
}

void prove_interlocks(void) {
  decide();
  const bool motor = sent.motor_duty > 0;
  const bool brake = sent.brake_duty > 0 || sent.brake_torque_Nm > 0;
  CLAIM(!motor || wish.may.motor, "no motor in a phase without");
  CLAIM(!brake || wish.may.brake, "no brake in a phase without");
  CLAIM(!(motor && brake) || wish.may.together, "not both at once");
  CLAIM(!motor || (wish.command.motor_enable && sent.motor_enable), "no motor that is not enabled");
  CLAIM(!motor || sent.motor_duty <= wish.command.motor_duty, "never more motor than wanted");
  CLAIM(sent.brake_duty <= 0 || sent.brake_duty <= wish.command.brake_duty, "never more brake than wanted");
#ifdef COVER /* each must fail: there is such a command */
  __CPROVER_assert(!(sent.motor_duty > 0.5 && deeds.bits == 0), "COVER drives");
  __CPROVER_assert(!(sent.brake_duty > 0.5), "COVER brakes");
  __CPROVER_assert(!(wish.faulty && sent.brake_duty > 0), "COVER the brake holds after a fault");
  __CPROVER_assert(deeds.last != GATE_MOTOR_RATE, "COVER the motor rises too fast");
  __CPROVER_assert(deeds.last != GATE_BRAKE_RATE, "COVER the brake rises too fast");
  __CPROVER_assert(deeds.last != GATE_MOTOR_BY_BRAKE, "COVER the brake has priority");
#endif
}

void prove_after_fault(void) {
  decide();
  if (!wish.faulty) return;
  CLAIM(sent.motor_duty == 0 && !sent.motor_enable, "no drive after a fault");
  CLAIM(sent.brake_duty <= limits.fault_brake_duty, "the brake holds at most fault_brake_duty");
  CLAIM(!wish.brake_barred || (sent.brake_duty == 0 && sent.brake_torque_Nm == 0), "no brake that a fault bars");
  CLAIM(deeds.last == GATE_REFUSED, "it is refused");
}

void prove_fault_time(void) {
  assume();
  const struct gate_state before = state;
  (void)gate_after_fault(&limits, &state, &wish);
  CLAIM(state.has_failed && state.fault_ns == (before.has_failed ? before.fault_ns : wish.now_ns),
        "the time of the first command after the fault stays");
}

void prove_rate(void) {
  const double duty = any_command().motor_duty, highest = any_command().motor_duty;
  __CPROVER_assume(!isnan(duty) && !isnan(highest));
  const double risen = gate_rising(duty, highest, GATE_MOTOR_RATE, &deeds);
  CLAIM(risen <= highest + gate_rise_rounding && risen <= duty, "no duty rises above the highest");
  CLAIM(deeds.bits == 0 || risen == highest, "and what is cut is cut to the highest");
}

void prove_passes(void) {
  assume();
  __CPROVER_assume(!wish.faulty && !state.has_sent && is_within(wish.command.motor_duty, 0, limits.motor_duty_max) &&
                   wish.command.motor_duty <= limits.motor_sendable &&
                   is_within(wish.command.brake_duty, 0, limits.brake_duty_max) &&
                   wish.command.brake_duty <= limits.brake_sendable && wish.command.brake_torque_Nm >= 0 &&
                   wish.command.motor_enable && wish.may.motor && wish.may.brake && wish.may.together);
  sent = gate_decide(&limits, &state, &wish, &deeds);
  CLAIM(sent.motor_duty == wish.command.motor_duty && sent.brake_duty == wish.command.brake_duty &&
          sent.brake_torque_Nm == wish.command.brake_torque_Nm && sent.motor_enable && deeds.bits == 0,
        "what is in order passes as it is");
}

void prove_note_sent(void) {
  assume();
  const struct gate_state before = state;
  const double motor = any_command().motor_duty, brake = any_command().brake_duty;
  __CPROVER_assume(is_within(motor, 0, 1) && is_within(brake, 0, 1)); /* CommandGate latches a fault for anything else */
  gate_note_sent(&state, motor, brake);
  CLAIM(holds(&state), "the state holds");
  CLAIM(state.motor_risen <= before.motor_risen && state.brake_risen <= before.brake_risen,
        "what the driver says lowers the next rise alone");
}
