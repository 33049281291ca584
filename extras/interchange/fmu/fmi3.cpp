// The functions of FMI 3.0 for co-simulation (https://fmi-standard.org, version 3.0.1).

#include <fmi/fmi3Functions.h>

#include <utility>

#include "interchange/fmu/component.hpp"

namespace {

using namespace abs_hil::interchange::fmu;

using Status = fmi3Status;
static_assert(ok<Status> == fmi3OK && failed<Status> == fmi3Error);

template <class Action>
fmi3Status done_with(size_t references, size_t values, fmi3Instance instance, const Action& action) {
  return done<Status>(instance, [&] {
    if (references != values)
      throw std::invalid_argument("as many values as references are needed: there are no arrays here");
    action();
  });
}

}  // namespace

extern "C" {

#define ABS_HIL_FMI(name) fmi3##name
#define ABS_HIL_FMI_OF_STATE(before, behind) fmi3##before##FMUState##behind
#define ABS_HIL_FMI_READ_STATE fmi3DeserializeFMUState
#include "interchange/fmu/both_versions.hpp"

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
    return new Component(token, resources_at(resources), logger);
  } catch (const std::exception& error) {
    logger(true, error.what());
    return nullptr;
  }
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean, fmi3Float64, fmi3Float64 start_s,
                                       fmi3Boolean, fmi3Float64) {
  return done<Status>(instance, [&] { of(instance)->set_start_time(start_s); });
}

// Reads and sets variables: FMI's name of the type, and the type in the model.
#define ABS_HIL_VALUES(type, Value)                                                                                    \
  fmi3Status fmi3Get##type(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3##type v[], size_t all) {       \
    return done_with(n, all, i, [&] { get_values<Value>(*of(i), r, n, v); });                                          \
  }                                                                                                                    \
  fmi3Status fmi3Set##type(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3##type v[], size_t all) { \
    return done_with(n, all, i, [&] { set_values<Value>(*of(i), r, n, v); });                                          \
  }
ABS_HIL_VALUES(Float64, double)
ABS_HIL_VALUES(Int32, std::int32_t)
ABS_HIL_VALUES(Boolean, bool)
ABS_HIL_VALUES(String, std::string)
#undef ABS_HIL_VALUES

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time_s, fmi3Float64 duration_s, fmi3Boolean,
                      fmi3Boolean* event_needed, fmi3Boolean* terminate, fmi3Boolean* early, fmi3Float64* last_time_s) {
  *event_needed = *terminate = *early = fmi3False;
  *last_time_s = time_s;
  return done<Status>(instance, [&] {
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
#define ABS_HIL_AT const fmi3ValueReference[], size_t
#define ABS_HIL_NOT_THERE(function, ...) \
  fmi3Status function(fmi3Instance i __VA_OPT__(, ) __VA_ARGS__) { return not_there<Status>(i, #function); }
#define ABS_HIL_NO_VALUES(type)                                      \
  ABS_HIL_NOT_THERE(fmi3Get##type, ABS_HIL_AT, fmi3##type[], size_t) \
  ABS_HIL_NOT_THERE(fmi3Set##type, ABS_HIL_AT, const fmi3##type[], size_t)
ABS_HIL_NO_VALUES(Float32)
ABS_HIL_NO_VALUES(Int8)
ABS_HIL_NO_VALUES(UInt8)
ABS_HIL_NO_VALUES(Int16)
ABS_HIL_NO_VALUES(UInt16)
ABS_HIL_NO_VALUES(UInt32)
ABS_HIL_NO_VALUES(Int64)
ABS_HIL_NO_VALUES(UInt64)
ABS_HIL_NOT_THERE(fmi3EnterEventMode)
ABS_HIL_NOT_THERE(fmi3GetBinary, ABS_HIL_AT, size_t[], fmi3Binary[], size_t)
ABS_HIL_NOT_THERE(fmi3GetClock, ABS_HIL_AT, fmi3Clock[])
ABS_HIL_NOT_THERE(fmi3SetBinary, ABS_HIL_AT, const size_t[], const fmi3Binary[], size_t)
ABS_HIL_NOT_THERE(fmi3SetClock, ABS_HIL_AT, const fmi3Clock[])
ABS_HIL_NOT_THERE(fmi3GetNumberOfVariableDependencies, fmi3ValueReference, size_t*)
ABS_HIL_NOT_THERE(fmi3GetVariableDependencies, fmi3ValueReference, size_t[], fmi3ValueReference[], size_t[],
                  fmi3DependencyKind[], size_t)
ABS_HIL_NOT_THERE(fmi3GetDirectionalDerivative, ABS_HIL_AT, ABS_HIL_AT, const fmi3Float64[], size_t, fmi3Float64[],
                  size_t)
ABS_HIL_NOT_THERE(fmi3GetAdjointDerivative, ABS_HIL_AT, ABS_HIL_AT, const fmi3Float64[], size_t, fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3EnterConfigurationMode)
ABS_HIL_NOT_THERE(fmi3ExitConfigurationMode)
ABS_HIL_NOT_THERE(fmi3GetIntervalDecimal, ABS_HIL_AT, fmi3Float64[], fmi3IntervalQualifier[])
ABS_HIL_NOT_THERE(fmi3GetIntervalFraction, ABS_HIL_AT, fmi3UInt64[], fmi3UInt64[], fmi3IntervalQualifier[])
ABS_HIL_NOT_THERE(fmi3GetShiftDecimal, ABS_HIL_AT, fmi3Float64[])
ABS_HIL_NOT_THERE(fmi3GetShiftFraction, ABS_HIL_AT, fmi3UInt64[], fmi3UInt64[])
ABS_HIL_NOT_THERE(fmi3SetIntervalDecimal, ABS_HIL_AT, const fmi3Float64[])
ABS_HIL_NOT_THERE(fmi3SetIntervalFraction, ABS_HIL_AT, const fmi3UInt64[], const fmi3UInt64[])
ABS_HIL_NOT_THERE(fmi3SetShiftDecimal, ABS_HIL_AT, const fmi3Float64[])
ABS_HIL_NOT_THERE(fmi3SetShiftFraction, ABS_HIL_AT, const fmi3UInt64[], const fmi3UInt64[])
ABS_HIL_NOT_THERE(fmi3EvaluateDiscreteStates)
ABS_HIL_NOT_THERE(fmi3UpdateDiscreteStates, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*,
                  fmi3Float64*)
ABS_HIL_NOT_THERE(fmi3EnterContinuousTimeMode)
ABS_HIL_NOT_THERE(fmi3CompletedIntegratorStep, fmi3Boolean, fmi3Boolean*, fmi3Boolean*)
ABS_HIL_NOT_THERE(fmi3SetTime, fmi3Float64)
ABS_HIL_NOT_THERE(fmi3SetContinuousStates, const fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3GetContinuousStateDerivatives, fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3GetEventIndicators, fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3GetContinuousStates, fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3GetNominalsOfContinuousStates, fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3GetNumberOfEventIndicators, size_t*)
ABS_HIL_NOT_THERE(fmi3GetNumberOfContinuousStates, size_t*)
ABS_HIL_NOT_THERE(fmi3EnterStepMode)
ABS_HIL_NOT_THERE(fmi3GetOutputDerivatives, ABS_HIL_AT, const fmi3Int32[], fmi3Float64[], size_t)
ABS_HIL_NOT_THERE(fmi3ActivateModelPartition, fmi3ValueReference, fmi3Float64)
#undef ABS_HIL_NO_VALUES
#undef ABS_HIL_NOT_THERE
#undef ABS_HIL_AT

}  // extern "C"
