/* A slip controller in a shared library, for `abs_hil --controller FILE.so` (docs/interchange.md). Plain C, and the only
 * header that such a library needs:
 *
 *   cc -shared -fPIC -O2 -I INCLUDE -o my_controller.so my_controller.c
 *
 * The library states its interface with ABS_HIL_CONTROLLER_INTERFACE and defines the functions below. All quantities
 * are in SI units; NaN means "not known". `reset` and `step` run in the real-time thread: no allocation, lock, system
 * call or output. `create` and `destroy` do not. One process may hold several instances, but each is used by one thread
 * at a time.
 */
#ifndef ABS_HIL_INTERCHANGE_CONTROLLER_H
#define ABS_HIL_INTERCHANGE_CONTROLLER_H

#include <stddef.h> /* NOLINT(modernize-deprecated-headers): C */
#include <stdint.h> /* NOLINT(modernize-deprecated-headers): C */

#ifdef __cplusplus
extern "C" {
#endif

// NOLINTBEGIN(modernize-use-using): C
/* The version changes when a library of the former version cannot work any more. Later fields are appended to the
 * structs, and the sizes say which of them a library knows. */
#define ABS_HIL_CONTROLLER_MAGIC 0x53424148u /* "HABS" */
#define ABS_HIL_CONTROLLER_VERSION 1u
#define ABS_HIL_CONTROLLER_SIGNALS 8 /* most signals of a controller's own */

/* What the library was compiled with. The program reads it in the file, before any code of the library runs. */
typedef struct abs_hil_controller_interface_t {
  uint32_t magic;
  uint32_t version;
  uint32_t setup_size;  /* sizeof(abs_hil_setup) */
  uint32_t input_size;  /* sizeof(abs_hil_input) */
  uint32_t output_size; /* sizeof(abs_hil_output) */
  uint32_t reserved;    /* 0 */
} abs_hil_controller_interface_t;

/* A number of the configuration: a key of `control.` or `model.` (`abs_hil list --keys`). */
typedef struct abs_hil_parameter {
  const char* name;
  double value;
} abs_hil_parameter;

/* Facts for `create`; valid during that call only. */
typedef struct abs_hil_setup {
  uint32_t size; /* sizeof(abs_hil_setup) of the program */
  uint32_t parameter_count;
  const abs_hil_parameter* parameters;
  double period_s; /* control period, > 0 */
} abs_hil_setup;

/* Inputs of one cycle of braking. */
typedef struct abs_hil_input {
  double time_s;               /* since `reset` */
  double dt_s;                 /* since the previous step; 0 in the first step after `reset` */
  double omega1_rad_s;         /* estimated speed of the upper, braked wheel */
  double omega2_rad_s;         /* estimated speed of the lower wheel, the road */
  double slip;                 /* estimated slip: 0 rolling, 1 locked */
  double slip_ref;             /* wanted slip, in (0, 1) */
  double mean_brake_torque_Nm; /* torque estimated to act, mean over the past interval */
  double brake_torque_Nm;      /* torque estimated to act now */
  double max_brake_torque_Nm;  /* largest torque that the brake can give, > 0; may be infinite */
  double alpha1_rad_s2;        /* estimated acceleration of the upper wheel */
  double alpha2_rad_s2;        /* estimated acceleration of the lower wheel */
  double upper_travel_rad;     /* angles turned over the past interval */
  double lower_travel_rad;
  double sent_brake_torque_Nm; /* what was sent in the previous cycle, after limits and the PWM's steps */
  double unsent_torque_Nm;     /* what was missing in it of the torque asked for: while not 0, an integral that drives
                                  the torque further out must stand */
} abs_hil_input;

/* Outputs of one cycle. All but the torque are NaN when `step` is called. An output that `step` sets in the first cycle
 * must be finite in every cycle; anything else ends the run with a fault that names it. */
typedef struct abs_hil_output {
  double brake_torque_Nm;                     /* wanted static torque; is limited afterwards; finite in every cycle */
  double slip_velocity_error_m_s;             /* e_v of (13) */
  double theta_est_N;                         /* estimated peak tyre force */
  double slip_ref;                            /* the controller's own reference */
  double signals[ABS_HIL_CONTROLLER_SIGNALS]; /* in the order of abs_hil_controller_signal */
} abs_hil_output;
// NOLINTEND(modernize-use-using)

#if defined(_WIN32)
#define ABS_HIL_EXPORT __declspec(dllexport)
#else
#define ABS_HIL_EXPORT __attribute__((visibility("default")))
#endif

/* Stands once in the library, at file scope. */
#ifdef __cplusplus
#define ABS_HIL_CONTROLLER_LINKAGE extern "C"
#else
#define ABS_HIL_CONTROLLER_LINKAGE
#endif
#define ABS_HIL_CONTROLLER_INTERFACE                                                                          \
  ABS_HIL_CONTROLLER_LINKAGE ABS_HIL_EXPORT extern const abs_hil_controller_interface_t abs_hil_controller_interface; \
  const abs_hil_controller_interface_t abs_hil_controller_interface = {ABS_HIL_CONTROLLER_MAGIC,              \
                                                                       ABS_HIL_CONTROLLER_VERSION,            \
                                                                       (uint32_t)sizeof(abs_hil_setup),       \
                                                                       (uint32_t)sizeof(abs_hil_input),       \
                                                                       (uint32_t)sizeof(abs_hil_output),      \
                                                                       0u}

/* Makes a controller. Returns null if it cannot; then `error` holds the reason, at most `error_size` bytes with the
 * closing 0. */
ABS_HIL_EXPORT void* abs_hil_controller_create(const abs_hil_setup* setup, char* error, size_t error_size);
/* Starts braking: discards the past and takes the state from this input. The first step follows in the same cycle. */
ABS_HIL_EXPORT void abs_hil_controller_reset(void* controller, const abs_hil_input* input);
/* Computes one control period. */
ABS_HIL_EXPORT void abs_hil_controller_step(void* controller, const abs_hil_input* input, abs_hil_output* output);
/* Name of the controller's own signal number `index`, with its unit at the end ("zeta_N"): letters, digits and '_', a
 * letter first, at most 32 characters. Null beyond the last. The text lives as long as the controller. */
ABS_HIL_EXPORT const char* abs_hil_controller_signal(void* controller, uint32_t index);
ABS_HIL_EXPORT void abs_hil_controller_destroy(void* controller);

#ifdef __cplusplus
}
#endif

#endif
