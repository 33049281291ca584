/* Controllers that misbehave, one for each value of BROKEN. They leave a trace, the file that ABS_HIL_TRACE names, when
 * any of their code runs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "abs_hil/interchange/controller.h"

#define SOUND 0
#define VERSION 1
#define SIZE 2
#define NO_INTERFACE 3
#define NO_STEP 4
#define REFUSES 5
#define DIES_IN_CREATE 6
#define DIES_IN_STEP 7
#define NOT_FINITE 8
#define HANGS 9
#define ALLOCATES 10
#define CALLS_SYSTEM 11
#define BAD_SIGNAL 12
#define MANY_SIGNALS 13
#define EXITS 14
#define MAGIC 15
#define DIES_LATE 16

#if BROKEN == NO_INTERFACE
int nothing;
#elif BROKEN == VERSION
ABS_HIL_EXPORT const abs_hil_controller_interface_t abs_hil_controller_interface = {
    ABS_HIL_CONTROLLER_MAGIC, 7u, sizeof(abs_hil_setup), sizeof(abs_hil_input), sizeof(abs_hil_output), 0u};
#elif BROKEN == SIZE
ABS_HIL_EXPORT const abs_hil_controller_interface_t abs_hil_controller_interface = {
    ABS_HIL_CONTROLLER_MAGIC, 1u, sizeof(abs_hil_setup), sizeof(abs_hil_input) - 8u, sizeof(abs_hil_output), 0u};
#elif BROKEN == MAGIC
ABS_HIL_EXPORT const abs_hil_controller_interface_t abs_hil_controller_interface = {
    1u, 1u, sizeof(abs_hil_setup), sizeof(abs_hil_input), sizeof(abs_hil_output), 0u};
#else
ABS_HIL_CONTROLLER_INTERFACE;
#endif

__attribute__((constructor)) static void leave_trace(void) {
  const char* path = getenv("ABS_HIL_TRACE");
  FILE* file = path == NULL ? NULL : fopen(path, "w");
  if (file != NULL) fclose(file);
}

static int steps;
static int* volatile nowhere;

void* abs_hil_controller_create(const abs_hil_setup* setup, char* error, size_t error_size) {
  (void)setup;
  if (BROKEN == DIES_IN_CREATE) *nowhere = 1;
  if (BROKEN == REFUSES) {
    snprintf(error, error_size, "no licence for this rig");
    return NULL;
  }
  return &steps;
}

void abs_hil_controller_reset(void* controller, const abs_hil_input* input) {
  (void)controller;
  (void)input;
  if (BROKEN != DIES_LATE) steps = 0;
}

#if BROKEN != NO_STEP
void abs_hil_controller_step(void* controller, const abs_hil_input* input, abs_hil_output* output) {
  (void)controller;
  static void* volatile block;
  ++steps;
  output->brake_torque_Nm = 4.0 * (input->slip_ref - input->slip) + 2.0;
  if (BROKEN == DIES_IN_STEP && steps == 100) *nowhere = 1;
  /* Only after the trials before a run. */
  if (BROKEN == DIES_LATE && steps == 2500) *nowhere = 1;
  if (BROKEN == EXITS && steps == 100) exit(5);
  if (BROKEN == NOT_FINITE && steps == 100) output->brake_torque_Nm = NAN;
  while (BROKEN == HANGS && steps == 100) {
  }
  if (BROKEN == ALLOCATES) {
    block = malloc(16);
    free(block);
  }
  if (BROKEN == CALLS_SYSTEM) (void)getppid();
}
#endif

const char* abs_hil_controller_signal(void* controller, uint32_t index) {
  (void)controller;
  static const char* const names[] = {"a", "b", "c", "d", "e", "f", "g", "h", "i"};
  if (BROKEN == MANY_SIGNALS) return index < 9 ? names[index] : NULL;
  if (BROKEN == BAD_SIGNAL) return index == 0 ? "a,b" : NULL;
  return NULL;
}

void abs_hil_controller_destroy(void* controller) { (void)controller; }
