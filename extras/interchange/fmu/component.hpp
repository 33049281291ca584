#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

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

}  // namespace abs_hil::interchange::fmu
