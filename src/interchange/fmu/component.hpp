#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "interchange/fmu/model.hpp"

namespace abs_hil::interchange::fmu {

/// Log message of an instance: true for an error.
using Logger = std::function<void(bool error, const std::string& text)>;

/// The state of an instance: the values of its parameters, and what it was given in every step since its start. To set
/// it, the instance starts again and repeats the steps. That is exact, because a model is a function of its inputs; and
/// it works for every law, whose state is its own.
struct State {
  std::vector<std::string> values{};  ///< texts of all variables but outputs
  bool started{false};
  double start_s{0.0};
  std::vector<double> steps{};  ///< for each step: duration and inputs, as numbers
};

[[nodiscard]] std::string to_bytes(const State& state);
/// Throws std::invalid_argument for bytes that `to_bytes` did not make.
[[nodiscard]] State state_of(const std::string& bytes);

/// One instance of an FMU, as both versions of the interface need it. Its methods throw std::invalid_argument.
class Component {
 public:
  /// @param token  what the description says; @param resources  the folder of the FMU's resources
  Component(std::string name, const std::string& token, const std::string& resources, Logger logger);

  [[nodiscard]] const Variable& variable(std::uint32_t reference) const;
  /// The variable, whose value is about to be set. Throws for an output, and for a parameter after the start.
  [[nodiscard]] const Variable& to_set(std::uint32_t reference) const;
  void set_start_time(double time_s) noexcept { start_s_ = time_s; }
  /// End of initialisation: the model begins.
  void start();
  void step(double time_s, double duration_s);
  /// As after instantiation.
  void reset();

  [[nodiscard]] State state() const;
  void restore(const State& state);
  void log(bool error, const std::string& text) const;

 private:
  [[nodiscard]] std::vector<double> inputs() const;
  void set_inputs(const double* values) const;

  std::string name_;
  std::unique_ptr<Model> model_;
  std::vector<std::string> first_values_{};
  Logger logger_;
  bool started_{false};
  double start_s_{0.0};
  double time_s_{0.0};
  std::vector<double> steps_{};
  std::size_t input_count_{0};
};

}  // namespace abs_hil::interchange::fmu
