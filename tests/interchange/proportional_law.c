/* The law of proportional_law.py once more, to compare with. */
#include <math.h>

#include "abs_hil/interchange/controller.h"

ABS_HIL_CONTROLLER_INTERFACE;

static int any;

void* abs_hil_controller_create(const abs_hil_setup* setup, char* error, size_t error_size) {
  (void)setup, (void)error, (void)error_size;
  return &any;
}
void abs_hil_controller_reset(void* controller, const abs_hil_input* in) { (void)controller, (void)in; }
void abs_hil_controller_step(void* controller, const abs_hil_input* in, abs_hil_output* out) {
  (void)controller;
  out->brake_torque_Nm = fmax(0.0, 2.0 + 10.0 * (0.3 - in->slip));
}
const char* abs_hil_controller_signal(void* controller, uint32_t index) {
  (void)controller, (void)index;
  return 0;
}
void abs_hil_controller_destroy(void* controller) { (void)controller; }
