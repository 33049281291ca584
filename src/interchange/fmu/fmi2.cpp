// The functions of FMI 2.0 for co-simulation (https://fmi-standard.org, version 2.0.4).

#include <fmi/fmi2Functions.h>

#include <utility>

#include "interchange/fmu/values.hpp"

namespace {

using namespace abs_hil::interchange::fmu;

template <class Action>
fmi2Status done(fmi2Component component, const Action& action) noexcept {
  return guarded(of(component), fmi2OK, fmi2Error, action);
}

}  // namespace

extern "C" {

const char* fmi2GetTypesPlatform() { return fmi2TypesPlatform; }
const char* fmi2GetVersion() { return fmi2Version; }

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
void fmi2FreeInstance(fmi2Component component) { delete of(component); }
fmi2Status fmi2SetDebugLogging(fmi2Component, fmi2Boolean, size_t, const fmi2String[]) { return fmi2OK; }

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean, fmi2Real, fmi2Real start_s, fmi2Boolean,
                               fmi2Real) {
  return done(component, [&] { of(component)->set_start_time(start_s); });
}
fmi2Status fmi2EnterInitializationMode(fmi2Component component) { return component == nullptr ? fmi2Error : fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
  return done(component, [&] { of(component)->start(); });
}
fmi2Status fmi2Terminate(fmi2Component component) { return component == nullptr ? fmi2Error : fmi2OK; }
fmi2Status fmi2Reset(fmi2Component component) {
  return done(component, [&] { of(component)->reset(); });
}

// Reads and sets variables: FMI's name of the type, and the type in the model.
#define ABS_HIL_VALUES(type, Value)                                                                         \
  fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2##type v[]) {       \
    return done(c, [&] { get_values<Value>(*of(c), r, n, v); });                                            \
  }                                                                                                         \
  fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2##type v[]) { \
    return done(c, [&] { set_values<Value>(*of(c), r, n, v); });                                            \
  }
ABS_HIL_VALUES(Real, double)
ABS_HIL_VALUES(Integer, std::int32_t)
ABS_HIL_VALUES(Boolean, bool)
ABS_HIL_VALUES(String, std::string)
#undef ABS_HIL_VALUES

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return done(c, [&] { keep(of(c)->state(), *state); });
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  return done(c, [&] { of(c)->restore(*static_cast<State*>(state)); });
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return done(c, [&] { delete static_cast<State*>(std::exchange(*state, nullptr)); });
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t* size) {
  return done(c, [&] { *size = to_bytes(*static_cast<State*>(state)).size(); });
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  return done(c, [&] { write_bytes(*static_cast<State*>(state), bytes, size); });
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate* state) {
  return done(c, [&] { keep(state_of(std::string(bytes, bytes + size)), *state); });
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference[], size_t, const fmi2ValueReference[],
                                        size_t, const fmi2Real[], fmi2Real[]) {
  return not_there(c, fmi2Error, "fmi2GetDirectionalDerivative");
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference[], size_t, const fmi2Integer[],
                                       const fmi2Real[]) {
  return not_there(c, fmi2Error, "fmi2SetRealInputDerivatives");
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference[], size_t, const fmi2Integer[],
                                        fmi2Real[]) {
  return not_there(c, fmi2Error, "fmi2GetRealOutputDerivatives");
}
fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time_s, fmi2Real duration_s, fmi2Boolean) {
  return done(component, [&] { of(component)->step(time_s, duration_s); });
}
fmi2Status fmi2CancelStep(fmi2Component c) { return not_there(c, fmi2Error, "fmi2CancelStep"); }
fmi2Status fmi2GetStatus(fmi2Component, const fmi2StatusKind, fmi2Status*) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component, const fmi2StatusKind, fmi2Real*) { return fmi2Discard; }
fmi2Status fmi2GetIntegerStatus(fmi2Component, const fmi2StatusKind, fmi2Integer*) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component, const fmi2StatusKind, fmi2Boolean*) { return fmi2Discard; }
fmi2Status fmi2GetStringStatus(fmi2Component, const fmi2StatusKind, fmi2String*) { return fmi2Discard; }

}  // extern "C"
