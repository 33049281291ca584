/* windows_fmu.exe DLL RESOURCES GUID: steps the plant's FMU 500 times by 1 ms with brake duty 0.6, then prints the values of
 * the references that stand on the command line after these three. */
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

#include "fmi2FunctionTypes.h"

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...) {
  (void)environment;
  (void)message;
  fprintf(stderr, "%s: %d %s\n", name, status, category);
}

#define FIND(name) name##TYPE* name = (name##TYPE*)(void*)GetProcAddress(library, #name)

int main(int argc, char** argv) {
  HMODULE library = LoadLibraryA(argv[1]);
  if (library == NULL) return 10;
  FIND(fmi2Instantiate);
  FIND(fmi2SetupExperiment);
  FIND(fmi2EnterInitializationMode);
  FIND(fmi2ExitInitializationMode);
  FIND(fmi2SetReal);
  FIND(fmi2GetReal);
  FIND(fmi2DoStep);
  FIND(fmi2FreeInstance);
  const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
  fmi2Component rig = fmi2Instantiate("rig", fmi2CoSimulation, argv[3], argv[2], &callbacks, fmi2False, fmi2True);
  if (rig == NULL) return 11;
  if (fmi2SetupExperiment(rig, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK || fmi2EnterInitializationMode(rig) != fmi2OK ||
      fmi2ExitInitializationMode(rig) != fmi2OK) {
    return 12;
  }
  const fmi2ValueReference brake = (fmi2ValueReference)atoi(argv[4]);
  const fmi2Real duty = 0.6;
  for (int n = 0; n < 500; ++n) {
    if (fmi2SetReal(rig, &brake, 1, &duty) != fmi2OK || fmi2DoStep(rig, n * 1e-3, 1e-3, fmi2True) != fmi2OK) return 13;
  }
  for (int n = 5; n < argc; ++n) {
    const fmi2ValueReference reference = (fmi2ValueReference)atoi(argv[n]);
    fmi2Real value = 0.0;
    if (fmi2GetReal(rig, &reference, 1, &value) != fmi2OK) return 14;
    printf("%.17g\n", value);
  }
  fmi2FreeInstance(rig);
  return 0;
}
