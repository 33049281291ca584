// The functions of FMI 2.0 for co-simulation (https://fmi-standard.org, version 2.0.4).

#include <fmi/fmi2Functions.h>

#include <utility>

#include "interchange/fmu/component.hpp"

namespace {

using namespace abs_hil::interchange::fmu;

using Status = fmi2Status;
static_assert(ok<Status> == fmi2OK && failed<Status> == fmi2Error);

}  // namespace

extern "C" {

#define ABS_HIL_FMI(name) fmi2##name
#define ABS_HIL_FMI_OF_STATE(before, behind) fmi2##before##FMUstate##behind
#define ABS_HIL_FMI_READ_STATE fmi2DeSerializeFMUstate
#include "interchange/fmu/both_versions.hpp"

const char* fmi2GetTypesPlatform() { return fmi2TypesPlatform; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* functions, fmi2Boolean /*visible*/, fmi2Boolean /*debug*/) {
  if (functions == nullptr || name == nullptr || guid == nullptr) return nullptr;
  const Logger logger = [logger = functions->logger, environment = functions->componentEnvironment,
                         own = std::string(name)](bool error, const std::string& text) {
    if (logger != nullptr) {
      logger(environment, own.c_str(), error ? fmi2Error : fmi2OK, error ? "logStatusError" : "logAll", "%s",
             text.c_str());
    }
  };
  try {
    if (type != fmi2CoSimulation) throw std::invalid_argument("this FMU is for co-simulation only");
    return new Component(guid, resources_at(resources), logger);
  } catch (const std::exception& error) {
    logger(true, error.what());
    return nullptr;
  }
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean, fmi2Real, fmi2Real start_s, fmi2Boolean,
                               fmi2Real) {
  return done<Status>(component, [&] { of(component)->set_start_time(start_s); });
}
fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
  return done<Status>(component, [] {});
}

// Reads and sets variables: FMI's name of the type, and the type in the model.
#define ABS_HIL_VALUES(type, Value)                                                                         \
  fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2##type v[]) {       \
    return done<Status>(c, [&] { get_values<Value>(*of(c), r, n, v); });                                    \
  }                                                                                                         \
  fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2##type v[]) { \
    return done<Status>(c, [&] { set_values<Value>(*of(c), r, n, v); });                                    \
  }
ABS_HIL_VALUES(Real, double)
ABS_HIL_VALUES(Integer, std::int32_t)
ABS_HIL_VALUES(Boolean, bool)
ABS_HIL_VALUES(String, std::string)
#undef ABS_HIL_VALUES

#define ABS_HIL_NOT_THERE(function, ...) \
  fmi2Status function(fmi2Component c __VA_OPT__(, ) __VA_ARGS__) { return not_there<Status>(c, #function); }
ABS_HIL_NOT_THERE(fmi2GetDirectionalDerivative, const fmi2ValueReference[], size_t, const fmi2ValueReference[], size_t,
                  const fmi2Real[], fmi2Real[])
ABS_HIL_NOT_THERE(fmi2SetRealInputDerivatives, const fmi2ValueReference[], size_t, const fmi2Integer[],
                  const fmi2Real[])
ABS_HIL_NOT_THERE(fmi2GetRealOutputDerivatives, const fmi2ValueReference[], size_t, const fmi2Integer[], fmi2Real[])
ABS_HIL_NOT_THERE(fmi2CancelStep)
#undef ABS_HIL_NOT_THERE
fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time_s, fmi2Real duration_s, fmi2Boolean) {
  return done<Status>(component, [&] { of(component)->step(time_s, duration_s); });
}
fmi2Status fmi2GetStatus(fmi2Component, const fmi2StatusKind, fmi2Status*) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component, const fmi2StatusKind, fmi2Real*) { return fmi2Discard; }
fmi2Status fmi2GetIntegerStatus(fmi2Component, const fmi2StatusKind, fmi2Integer*) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component, const fmi2StatusKind, fmi2Boolean*) { return fmi2Discard; }
fmi2Status fmi2GetStringStatus(fmi2Component, const fmi2StatusKind, fmi2String*) { return fmi2Discard; }

}  // extern "C"
