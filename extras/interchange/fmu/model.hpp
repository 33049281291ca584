// What an FMU computes, and its variables.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/option.hpp"
#include "abs_hil/rig/state_bytes.hpp"

namespace abs_hil::interchange::fmu {

enum class Causality : std::uint8_t { parameter, input, output };

/// A variable of an FMU. Its place in the list is its value reference.
struct Variable {
  std::string name;
  rig::OptionFacts facts;  ///< unit, meaning, range
  Causality causality{Causality::parameter};
  rig::OptionTarget value;  ///< double, int32, bool or text in the model
};

/// What an FMU computes: the simulated rig, or a slip controller with its observers. The exporter asks it for its
/// variables, the FMU's binary runs it. No clock, no thread, no file.
class Model {
 public:
  Model() = default;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;
  virtual ~Model() = default;

  [[nodiscard]] const std::vector<Variable>& variables() const noexcept { return variables_; }
  /// Begins with the present parameters; afterwards the outputs are those at the start. Throws std::invalid_argument,
  /// which names the parameter, if one cannot work.
  virtual void start(double time_s) = 0;
  /// Goes on by `duration_s` > 0 under the present inputs. Throws std::invalid_argument for a bad input or duration.
  virtual void step(double duration_s) = 0;
  /// True for a parameter that may change between steps too.
  [[nodiscard]] virtual bool tunable(const Variable& /*parameter*/) const { return false; }
  /// Called after the start when such a parameter is set, before the next step.
  virtual void tuned(const Variable& /*parameter*/) {}
  /// All that `start` and `step` have made, but not the variables. Between `start` and the end.
  virtual void exchange_state(rig::StateBytes& state) = 0;

 protected:
  /// The rows of `options` as variables; rows that `wanted` refuses are left out.
  template <class Options>
  void add(
      Causality causality, Options& options, const std::string& prefix = {},
      bool (*wanted)(std::string_view name) = [](std::string_view) { return true; }) {
    rig::for_each_option(options, prefix, [&](const std::string& name, const rig::OptionFacts& facts, auto& value) {
      if (wanted(name)) variables_.push_back({name, facts, causality, &value});
    });
  }

 private:
  std::vector<Variable> variables_{};
};

/// Kinds of models, as in the FMU's instantiation token and in `export-fmu`.
inline constexpr std::string_view plant_kind = "plant";
inline constexpr std::string_view controller_kind = "controller";

/// The model of that kind with default parameters; null for an unknown kind.
[[nodiscard]] std::unique_ptr<Model> make_model(std::string_view kind);

/// Names, types and order of the variables as a number: a binary refuses a description that another version made.
[[nodiscard]] std::string token_of(std::string_view kind, const Model& model);

/// Sets a variable from the text of its value, as `text_of` writes it. Throws std::invalid_argument.
void set_text(const Variable& variable, const std::string& text);
[[nodiscard]] std::string text_of(const Variable& variable);
/// Throws std::invalid_argument, naming variable, value and range, unless the row allows the value.
void check(const Variable& variable);

}  // namespace abs_hil::interchange::fmu
