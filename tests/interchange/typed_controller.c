/* A controller FMU whose variables are all of one type, by the standard's own headers. It copies two inputs to two outputs,
 * and its parameter to the third. -DFMI=2 or 3, -DTYPE=Int8: FMI's name of the type. What it was given as the place of its
 * resources goes to stderr. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define JOIN(a, b, c) a##b##c
#define NAME(a, b, c) JOIN(a, b, c)
#if FMI == 2
#include <fmi/fmi2Functions.h>
#define VALUES
#else
#include <fmi/fmi3Functions.h>
#define VALUES , size_t all
#endif

enum { speed = 1, acceleration, torque, speed_copy, acceleration_copy, parameter, count };
typedef NAME(fmi, FMI, TYPE) Value;
typedef struct {
  Value values[count];
} Model;

static void* instance(const char* resources) {
  fprintf(stderr, "resources: %s\n", resources);
  return calloc(1, sizeof(Model));
}
static void step(Model* m) {
  m->values[speed_copy] = m->values[speed];
  m->values[acceleration_copy] = m->values[acceleration];
  m->values[torque] = m->values[parameter];
}

NAME(fmi, FMI, Status)
NAME(NAME(fmi, FMI, Set), TYPE, )(void* c, const NAME(fmi, FMI, ValueReference) r[], size_t n, const Value v[] VALUES) {
  for (size_t k = 0; k < n; ++k) ((Model*)c)->values[r[k]] = v[k];
  return 0;
}
NAME(fmi, FMI, Status)
NAME(NAME(fmi, FMI, Get), TYPE, )(void* c, const NAME(fmi, FMI, ValueReference) r[], size_t n, Value v[] VALUES) {
  for (size_t k = 0; k < n; ++k) v[k] = ((Model*)c)->values[r[k]];
  return 0;
}

#if FMI == 2
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* functions, fmi2Boolean visible, fmi2Boolean debug) {
  return instance(resources);
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) { return 0; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return 0; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return 0; }
fmi2Status fmi2Reset(fmi2Component c) { return 0; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) {
  step(c);
  return 0;
}
#else
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference r[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  return instance(resources);
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  return 0;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return 0; }
fmi3Status fmi3Reset(fmi3Instance c) { return 0; }
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no, fmi3Boolean* event, fmi3Boolean* end,
                      fmi3Boolean* early, fmi3Float64* last) {
  step(c);
  *event = *end = *early = 0;
  *last = t + h;
  return 0;
}
#endif
