/* The controller `pi` of abs_hil once more, as a shared library in C (docs/interchange.md). It reads its gains from the
 * same keys, so that both can be compared:
 *
 *   cc -shared -fPIC -O2 -I include -o pi_controller.so examples/c_controller/pi_controller.c -lm
 *   abs_hil --fast --no-lcm --controller ./pi_controller.so --set control.pi.kp_per_s=30
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "abs_hil/interchange/controller.h"

ABS_HIL_CONTROLLER_INTERFACE;

typedef struct pi_controller {
  double r1_m, r2_m, J1_kg_m2, J2_kg_m2, d1_Nms_rad, d2_Nms_rad, M10_Nm, M20_Nm;
  double kp_per_s, ki_per_s2, feed_forward;
  double integral_m, error_m_s, slip_ref;
} pi_controller;

/* Reads a number of the configuration; names the first one that is missing. */
static double parameter(const abs_hil_setup* setup, const char* name, const char** missing) {
  for (uint32_t n = 0; n < setup->parameter_count; ++n) {
    if (strcmp(setup->parameters[n].name, name) == 0) return setup->parameters[n].value;
  }
  if (*missing == NULL) *missing = name;
  return 0.0;
}

void* abs_hil_controller_create(const abs_hil_setup* setup, char* error, size_t error_size) {
  const char* missing = NULL;
  pi_controller* c = calloc(1, sizeof *c);
  if (c == NULL) return NULL;
  c->r1_m = parameter(setup, "model.r1_m", &missing);
  c->r2_m = parameter(setup, "model.r2_m", &missing);
  c->J1_kg_m2 = parameter(setup, "model.J1_kg_m2", &missing);
  c->J2_kg_m2 = parameter(setup, "model.J2_kg_m2", &missing);
  c->d1_Nms_rad = parameter(setup, "model.d1_Nms_rad", &missing);
  c->d2_Nms_rad = parameter(setup, "model.d2_Nms_rad", &missing);
  c->M10_Nm = parameter(setup, "model.M10_Nm", &missing);
  c->M20_Nm = parameter(setup, "model.M20_Nm", &missing);
  c->ki_per_s2 = parameter(setup, "control.pi.ki_per_s2", &missing);
  c->feed_forward = parameter(setup, "control.pi.feed_forward", &missing);
  /* The brake holds its torque for a period: this gain makes the error decay as the one in continuous time would. */
  c->kp_per_s = -expm1(-parameter(setup, "control.pi.kp_per_s", &missing) * setup->period_s) / setup->period_s;
  if (missing != NULL) {
    snprintf(error, error_size, "the program has no parameter %s", missing);
    free(c);
    return NULL;
  }
  return c;
}

/* (13) e_v = (1 - slip_ref) v_x - v_w */
static double slip_velocity_error_m_s(const pi_controller* c, const abs_hil_input* in) {
  return (1.0 - in->slip_ref) * c->r2_m * in->omega2_rad_s - c->r1_m * in->omega1_rad_s;
}

/* The torque that holds e_v, with the tyre force that the lower wheel's deceleration shows. */
static double equivalent_torque_Nm(const pi_controller* c, const abs_hil_input* in) {
  const double force_N =
      -(c->J2_kg_m2 * in->alpha2_rad_s2 + c->d2_Nms_rad * in->omega2_rad_s + c->M20_Nm) / c->r2_m;
  const double gain = c->r1_m * c->r1_m / c->J1_kg_m2 + (1.0 - in->slip_ref) * c->r2_m * c->r2_m / c->J2_kg_m2;
  const double drift_m_s2 =
      -c->r1_m / c->J1_kg_m2 * (c->d1_Nms_rad * in->omega1_rad_s + c->M10_Nm) +
      (1.0 - in->slip_ref) * c->r2_m / c->J2_kg_m2 * (c->d2_Nms_rad * in->omega2_rad_s + c->M20_Nm);
  return c->J1_kg_m2 / c->r1_m * (gain * fmax(0.0, force_N) + drift_m_s2);
}

void abs_hil_controller_reset(void* controller, const abs_hil_input* in) {
  pi_controller* c = controller;
  c->integral_m = 0.0;
  c->error_m_s = slip_velocity_error_m_s(c, in);
  c->slip_ref = in->slip_ref;
}

void abs_hil_controller_step(void* controller, const abs_hil_input* in, abs_hil_output* out) {
  pi_controller* c = controller;
  const double error_m_s = slip_velocity_error_m_s(c, in);
  /* A change of the reference makes e_v jump; the past interval must not include this jump. */
  const double mean_m_s = 0.5 * (c->error_m_s + error_m_s + (in->slip_ref - c->slip_ref) * c->r2_m * in->omega2_rad_s);
  if (in->unsent_torque_Nm * mean_m_s >= 0.0) c->integral_m += mean_m_s * in->dt_s;
  c->error_m_s = error_m_s;
  c->slip_ref = in->slip_ref;
  out->slip_velocity_error_m_s = error_m_s;
  out->brake_torque_Nm = c->feed_forward * equivalent_torque_Nm(c, in) +
                         c->J1_kg_m2 / c->r1_m * (-c->kp_per_s * error_m_s - c->ki_per_s2 * c->integral_m);
  out->signals[0] = c->integral_m;
}

const char* abs_hil_controller_signal(void* controller, uint32_t index) {
  (void)controller;
  return index == 0 ? "integral_m" : NULL;
}

void abs_hil_controller_destroy(void* controller) { free(controller); }
