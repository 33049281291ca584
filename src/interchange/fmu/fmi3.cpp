// The functions of FMI 3.0 for co-simulation (https://fmi-standard.org, version 3.0.1).

#include <fmi/fmi3Functions.h>

#include <cstring>

#include "interchange/fmu/values.hpp"

namespace {

using namespace abs_hil::interchange::fmu;

Component* of(fmi3Instance instance) { return static_cast<Component*>(instance); }

template <class Action>
fmi3Status done(fmi3Instance instance, const Action& action) noexcept {
  return guarded(of(instance), fmi3OK, fmi3Error, action);
}

fmi3Status not_there(fmi3Instance instance, const char* what) noexcept {
  if (instance != nullptr) of(instance)->log(true, std::string(what) + ": this FMU cannot do that");
  return fmi3Error;
}

void require_equal(size_t references, size_t values) {
  if (references != values)
    throw std::invalid_argument("as many values as references are needed: there are no arrays here");
}

}  // namespace

extern "C" {

const char* fmi3GetVersion() { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance, fmi3Boolean, size_t, const fmi3String[]) { return fmi3OK; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean /*visible*/, fmi3Boolean /*logging*/, fmi3Boolean /*events*/,
                                         fmi3Boolean /*early*/, const fmi3ValueReference[], size_t,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback) {
  if (name == nullptr || token == nullptr) return nullptr;
  const Logger logger = [log, environment](bool error, const std::string& text) {
    if (log != nullptr) {
      log(environment, error ? fmi3Error : fmi3OK, error ? "logStatusError" : "logAll", text.c_str());
    }
  };
  try {
    return new Component(name, token, path_of(resources == nullptr ? "" : resources), logger);
  } catch (const std::exception& error) {
    logger(true, error.what());
    return nullptr;
  }
}
void fmi3FreeInstance(fmi3Instance instance) { delete of(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean, fmi3Float64, fmi3Float64 start_s,
                                       fmi3Boolean, fmi3Float64) {
  return done(instance, [&] { of(instance)->set_start_time(start_s); });
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
  return done(instance, [&] { of(instance)->start(); });
}
fmi3Status fmi3Terminate(fmi3Instance instance) { return instance == nullptr ? fmi3Error : fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance instance) {
  return done(instance, [&] { of(instance)->reset(); });
}

fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    get_values<double>(*of(i), r, n, v);
  });
}
fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[],
                          size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    set_values<double>(*of(i), r, n, v);
  });
}
fmi3Status fmi3GetInt32(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Int32 v[], size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    get_values<std::int32_t>(*of(i), r, n, v);
  });
}
fmi3Status fmi3SetInt32(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Int32 v[], size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    set_values<std::int32_t>(*of(i), r, n, v);
  });
}
fmi3Status fmi3GetBoolean(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Boolean v[], size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    get_values<bool>(*of(i), r, n, v);
  });
}
fmi3Status fmi3SetBoolean(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Boolean v[],
                          size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    set_values<bool>(*of(i), r, n, v);
  });
}
fmi3Status fmi3GetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    get_values<std::string>(*of(i), r, n, v);
  });
}
fmi3Status fmi3SetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t values) {
  return done(i, [&] {
    require_equal(n, values);
    set_values<std::string>(*of(i), r, n, v);
  });
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState* state) {
  return done(c, [&] {
    if (*state == nullptr) *state = new State;
    *static_cast<State*>(*state) = of(c)->state();
  });
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  return done(c, [&] { of(c)->restore(*static_cast<State*>(state)); });
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState* state) {
  return done(c, [&] {
    delete static_cast<State*>(*state);
    *state = nullptr;
  });
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t* size) {
  return done(c, [&] { *size = to_bytes(*static_cast<State*>(state)).size(); });
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  return done(c, [&] {
    const std::string made = to_bytes(*static_cast<State*>(state));
    if (size < made.size())
      throw std::invalid_argument("the serialised state needs " + std::to_string(made.size()) + " bytes");
    std::memcpy(bytes, made.data(), made.size());
  });
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState* state) {
  return done(c, [&] {
    State read = state_of(std::string(reinterpret_cast<const char*>(bytes), size));
    if (*state == nullptr) *state = new State;
    *static_cast<State*>(*state) = std::move(read);
  });
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time_s, fmi3Float64 duration_s, fmi3Boolean,
                      fmi3Boolean* event_needed, fmi3Boolean* terminate, fmi3Boolean* early, fmi3Float64* last_time_s) {
  *event_needed = *terminate = *early = fmi3False;
  *last_time_s = time_s;
  return done(instance, [&] {
    of(instance)->step(time_s, duration_s);
    *last_time_s = time_s + duration_s;
  });
}

// What these FMUs do not have.
fmi3Instance fmi3InstantiateModelExchange(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                          fmi3InstanceEnvironment, fmi3LogMessageCallback) {
  return nullptr;
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                               fmi3InstanceEnvironment, fmi3LogMessageCallback, fmi3ClockUpdateCallback,
                                               fmi3LockPreemptionCallback, fmi3UnlockPreemptionCallback) {
  return nullptr;
}
fmi3Status fmi3EnterEventMode(fmi3Instance instance) { return not_there(instance, "fmi3EnterEventMode"); }
fmi3Status fmi3GetFloat32(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Float32[], size_t) {
  return not_there(instance, "fmi3GetFloat32");
}
fmi3Status fmi3GetInt8(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Int8[], size_t) {
  return not_there(instance, "fmi3GetInt8");
}
fmi3Status fmi3GetUInt8(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt8[], size_t) {
  return not_there(instance, "fmi3GetUInt8");
}
fmi3Status fmi3GetInt16(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Int16[], size_t) {
  return not_there(instance, "fmi3GetInt16");
}
fmi3Status fmi3GetUInt16(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt16[], size_t) {
  return not_there(instance, "fmi3GetUInt16");
}
fmi3Status fmi3GetUInt32(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt32[], size_t) {
  return not_there(instance, "fmi3GetUInt32");
}
fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Int64[], size_t) {
  return not_there(instance, "fmi3GetInt64");
}
fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt64[], size_t) {
  return not_there(instance, "fmi3GetUInt64");
}
fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference[], size_t, size_t[], fmi3Binary[], size_t) {
  return not_there(instance, "fmi3GetBinary");
}
fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Clock[]) {
  return not_there(instance, "fmi3GetClock");
}
fmi3Status fmi3SetFloat32(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Float32[], size_t) {
  return not_there(instance, "fmi3SetFloat32");
}
fmi3Status fmi3SetInt8(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Int8[], size_t) {
  return not_there(instance, "fmi3SetInt8");
}
fmi3Status fmi3SetUInt8(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt8[], size_t) {
  return not_there(instance, "fmi3SetUInt8");
}
fmi3Status fmi3SetInt16(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Int16[], size_t) {
  return not_there(instance, "fmi3SetInt16");
}
fmi3Status fmi3SetUInt16(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt16[], size_t) {
  return not_there(instance, "fmi3SetUInt16");
}
fmi3Status fmi3SetUInt32(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt32[], size_t) {
  return not_there(instance, "fmi3SetUInt32");
}
fmi3Status fmi3SetInt64(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Int64[], size_t) {
  return not_there(instance, "fmi3SetInt64");
}
fmi3Status fmi3SetUInt64(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt64[], size_t) {
  return not_there(instance, "fmi3SetUInt64");
}
fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference[], size_t, const size_t[], const fmi3Binary[],
                         size_t) {
  return not_there(instance, "fmi3SetBinary");
}
fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Clock[]) {
  return not_there(instance, "fmi3SetClock");
}
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference, size_t*) {
  return not_there(instance, "fmi3GetNumberOfVariableDependencies");
}
fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference, size_t[], fmi3ValueReference[],
                                       size_t[], fmi3DependencyKind[], size_t) {
  return not_there(instance, "fmi3GetVariableDependencies");
}
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                        const fmi3ValueReference[], size_t, const fmi3Float64[], size_t, fmi3Float64[],
                                        size_t) {
  return not_there(instance, "fmi3GetDirectionalDerivative");
}
fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                    const fmi3ValueReference[], size_t, const fmi3Float64[], size_t, fmi3Float64[],
                                    size_t) {
  return not_there(instance, "fmi3GetAdjointDerivative");
}
fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
  return not_there(instance, "fmi3EnterConfigurationMode");
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) { return not_there(instance, "fmi3ExitConfigurationMode"); }
fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Float64[],
                                  fmi3IntervalQualifier[]) {
  return not_there(instance, "fmi3GetIntervalDecimal");
}
fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt64[],
                                   fmi3UInt64[], fmi3IntervalQualifier[]) {
  return not_there(instance, "fmi3GetIntervalFraction");
}
fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Float64[]) {
  return not_there(instance, "fmi3GetShiftDecimal");
}
fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt64[], fmi3UInt64[]) {
  return not_there(instance, "fmi3GetShiftFraction");
}
fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Float64[]) {
  return not_there(instance, "fmi3SetIntervalDecimal");
}
fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt64[],
                                   const fmi3UInt64[]) {
  return not_there(instance, "fmi3SetIntervalFraction");
}
fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Float64[]) {
  return not_there(instance, "fmi3SetShiftDecimal");
}
fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt64[],
                                const fmi3UInt64[]) {
  return not_there(instance, "fmi3SetShiftFraction");
}
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
  return not_there(instance, "fmi3EvaluateDiscreteStates");
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*,
                                    fmi3Boolean*, fmi3Float64*) {
  return not_there(instance, "fmi3UpdateDiscreteStates");
}
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
  return not_there(instance, "fmi3EnterContinuousTimeMode");
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean, fmi3Boolean*, fmi3Boolean*) {
  return not_there(instance, "fmi3CompletedIntegratorStep");
}
fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64) { return not_there(instance, "fmi3SetTime"); }
fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64[], size_t) {
  return not_there(instance, "fmi3SetContinuousStates");
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64[], size_t) {
  return not_there(instance, "fmi3GetContinuousStateDerivatives");
}
fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64[], size_t) {
  return not_there(instance, "fmi3GetEventIndicators");
}
fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64[], size_t) {
  return not_there(instance, "fmi3GetContinuousStates");
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64[], size_t) {
  return not_there(instance, "fmi3GetNominalsOfContinuousStates");
}
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t*) {
  return not_there(instance, "fmi3GetNumberOfEventIndicators");
}
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t*) {
  return not_there(instance, "fmi3GetNumberOfContinuousStates");
}
fmi3Status fmi3EnterStepMode(fmi3Instance instance) { return not_there(instance, "fmi3EnterStepMode"); }
fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3Int32[],
                                    fmi3Float64[], size_t) {
  return not_there(instance, "fmi3GetOutputDerivatives");
}
fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference, fmi3Float64) {
  return not_there(instance, "fmi3ActivateModelPartition");
}

}  // extern "C"
