#pragma once

#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "interchange/file_uri.hpp"
#include "interchange/fmu/model.hpp"

namespace abs_hil::interchange::fmu {

/// Log message of an instance: true for an error.
using Logger = std::function<void(bool error, const std::string& text)>;

/// The state of an instance at one time, as bytes of this build: parameters, inputs, outputs and what the model is made
/// of.
using State = std::string;

[[nodiscard]] std::string to_bytes(const State& state);
/// Throws std::invalid_argument for bytes that `to_bytes` did not make.
[[nodiscard]] State state_of(const std::string& bytes);

/// One instance of an FMU, as both versions of the interface need it. Its methods throw std::invalid_argument.
class Component {
 public:
  /// @param token  what the description says; @param resources  the folder of the FMU's resources
  Component(const std::string& token, const std::filesystem::path& resources, Logger logger);

  [[nodiscard]] const Variable& variable(std::uint32_t reference) const;
  /// The variable, whose value is about to be set. Throws for an output, and after the start for a parameter that is
  /// not tunable.
  [[nodiscard]] const Variable& to_set(std::uint32_t reference);
  void set_start_time(double time_s) noexcept { start_s_ = time_s; }
  /// End of initialisation: the model begins.
  void start();
  void step(double time_s, double duration_s);
  /// As after instantiation.
  void reset();

  [[nodiscard]] State state();
  void restore(const State& state);
  void log(bool error, const std::string& text) const;

 private:
  void exchange_state(rig::StateBytes& bytes);

  std::string token_;
  std::unique_ptr<Model> model_;
  State first_{};
  Logger logger_;
  bool started_{false};
  double start_s_{0.0};
  double time_s_{0.0};
};

/// The instance behind a tool's pointer.
[[nodiscard]] inline Component* of(void* instance) noexcept { return static_cast<Component*>(instance); }

/// Both versions give these statuses the same numbers.
template <class Status>
constexpr Status ok = static_cast<Status>(0);
template <class Status>
constexpr Status failed = static_cast<Status>(3);

/// Calls `action`; what it throws goes to the instance's log, and the call has failed.
template <class Status, class Action>
Status done(void* instance, const Action& action) noexcept {
  if (instance == nullptr) return failed<Status>;
  try {
    action();
    return ok<Status>;
  } catch (const std::exception& error) {
    of(instance)->log(true, error.what());
    return failed<Status>;
  }
}

/// Answers a function that these FMUs do not have.
template <class Status>
Status not_there(void* instance, const char* function) noexcept {
  return done<Status>(instance,
                      [function] { throw std::invalid_argument(std::string(function) + ": this FMU cannot do that"); });
}

/// Gives a state to the tool, in the object that it has from a call before, or in a new one.
inline void keep(State state, void*& kept) {
  if (kept == nullptr) kept = new State;
  *static_cast<State*>(kept) = std::move(state);
}
inline void write_bytes(const State& state, void* bytes, std::size_t size) {
  const std::string made = to_bytes(state);
  if (size < made.size())
    throw std::invalid_argument("the serialised state needs " + std::to_string(made.size()) + " bytes");
  std::memcpy(bytes, made.data(), made.size());
}

/// The variable's value of that type, or an exception that names both.
template <class Value>
Value& value_of(const Variable& variable) {
  if (auto* const* value = std::get_if<Value*>(&variable.value)) return **value;
  throw std::invalid_argument(variable.name + " has another type");
}

template <class Value, class Reference, class Out>
void get_values(const Component& component, const Reference* references, std::size_t count, Out* values) {
  for (std::size_t n = 0; n < count; ++n) {
    const Value& value = value_of<Value>(component.variable(static_cast<std::uint32_t>(references[n])));
    if constexpr (std::is_same_v<Value, std::string>) {
      values[n] = value.c_str();
    } else {
      values[n] = static_cast<Out>(value);
    }
  }
}

/// A value that the variable's row refuses is not taken.
template <class Value, class Reference, class In>
void set_values(Component& component, const Reference* references, std::size_t count, const In* values) {
  for (std::size_t n = 0; n < count; ++n) {
    const Variable& variable = component.to_set(static_cast<std::uint32_t>(references[n]));
    Value& value = value_of<Value>(variable);
    const Value before = value;
    if constexpr (std::is_same_v<Value, bool>) {
      value = static_cast<bool>(values[n]);
    } else {
      value = values[n];
    }
    try {
      check(variable);
    } catch (...) {
      value = before;
      throw;
    }
  }
}

/// The folder of an FMU's resources: FMI 2 gives its URI, FMI 3 its path.
[[nodiscard]] inline std::filesystem::path resources_at(const char* place) {
  const std::string path = interchange::path_of_uri(place == nullptr ? "" : place);
  return std::u8string(path.begin(), path.end());
}

}  // namespace abs_hil::interchange::fmu
