#include "interchange/fmu/component.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <type_traits>

namespace abs_hil::interchange::fmu {

namespace {

std::string_view kind_in(const std::string& token) {
  for (const std::string_view kind : {plant_kind, controller_kind}) {
    if (token.starts_with("abs_hil-" + std::string(kind) + '-')) return kind;
  }
  return {};
}

void put(std::string& bytes, const void* data, std::size_t size) { bytes.append(static_cast<const char*>(data), size); }
void put_size(std::string& bytes, std::uint64_t size) { put(bytes, &size, sizeof size); }

/// Takes numbers and texts off the front of bytes.
class Bytes {
 public:
  explicit Bytes(const std::string& bytes) : bytes_(bytes) {}
  void take(void* data, std::size_t size) {
    if (size > bytes_.size() - place_) throw std::invalid_argument("the serialised state is cut short or damaged");
    std::memcpy(data, bytes_.data() + place_, size);
    place_ += size;
  }
  std::uint64_t take_size(std::size_t each) {
    std::uint64_t size = 0;
    take(&size, sizeof size);
    if (size > (bytes_.size() - place_) / each) throw std::invalid_argument("the serialised state is damaged");
    return size;
  }

 private:
  const std::string& bytes_;
  std::size_t place_{0};
};

constexpr std::string_view state_mark = "abs_hil state 1\n";

}  // namespace

std::string to_bytes(const State& state) {
  std::string bytes(state_mark);
  put_size(bytes, state.values.size());
  for (const std::string& value : state.values) {
    put_size(bytes, value.size());
    bytes += value;
  }
  const std::uint64_t started = state.started ? 1 : 0;
  put_size(bytes, started);
  put(bytes, &state.start_s, sizeof state.start_s);
  put_size(bytes, state.steps.size());
  put(bytes, state.steps.data(), state.steps.size() * sizeof(double));
  return bytes;
}

State state_of(const std::string& bytes) {
  if (!bytes.starts_with(state_mark)) throw std::invalid_argument("not a serialised state of this FMU");
  Bytes rest(bytes);
  std::string mark(state_mark.size(), '\0');
  rest.take(mark.data(), mark.size());
  State state;
  state.values.resize(rest.take_size(sizeof(std::uint64_t)));
  for (std::string& value : state.values) {
    value.resize(rest.take_size(1));
    rest.take(value.data(), value.size());
  }
  std::uint64_t started = 0;
  rest.take(&started, sizeof started);
  state.started = started != 0;
  rest.take(&state.start_s, sizeof state.start_s);
  state.steps.resize(rest.take_size(sizeof(double)));
  rest.take(state.steps.data(), state.steps.size() * sizeof(double));
  return state;
}

Component::Component(std::string name, const std::string& token, const std::string& resources, Logger logger)
    : name_(std::move(name)), model_(make_model(kind_in(token))), logger_(std::move(logger)) {
  if (!model_ || token != token_of(kind_in(token), *model_)) {
    throw std::invalid_argument("the description (token " + token +
                                ") does not belong to this binary; export the FMU again");
  }
  const std::string path = resources + "/start.txt";
  std::ifstream file(path);
  if (!file) throw std::invalid_argument("cannot read the parameters in " + path);
  std::string line;
  for (const Variable& variable : model_->variables()) {
    if (variable.causality == Causality::input) ++input_count_;
    if (variable.causality != Causality::parameter) continue;
    const std::string key = variable.name + '=';
    if (!std::getline(file, line) || !line.starts_with(key)) {
      throw std::invalid_argument(path + " does not name " + variable.name + " where it should");
    }
    set_text(variable, line.substr(key.size()));
  }
  first_values_ = state().values;
}

const Variable& Component::variable(std::uint32_t reference) const {
  if (reference < 1 || reference > model_->variables().size()) {
    throw std::invalid_argument("value reference " + std::to_string(reference) + " is unknown");
  }
  return model_->variables()[reference - 1];
}

const Variable& Component::to_set(std::uint32_t reference) const {
  const Variable& found = variable(reference);
  if (found.causality == Causality::output) throw std::invalid_argument(found.name + " is an output; it cannot be set");
  if (found.causality == Causality::parameter && started_) {
    throw std::invalid_argument(found.name + " is a fixed parameter; set it before the initialisation ends");
  }
  return found;
}

void Component::start() {
  for (const Variable& variable : model_->variables()) check(variable);
  model_->start(start_s_);
  started_ = true;
  time_s_ = start_s_;
  steps_.clear();
}

std::vector<double> Component::inputs() const {
  std::vector<double> values;
  for (const Variable& variable : model_->variables()) {
    if (variable.causality != Causality::input) continue;
    std::visit(
        [&](const auto* value) {
          using Value = std::remove_cvref_t<decltype(*value)>;
          if constexpr (!std::is_same_v<Value, std::string>) values.push_back(static_cast<double>(*value));
        },
        variable.value);
  }
  return values;
}

void Component::set_inputs(const double* values) const {
  for (const Variable& variable : model_->variables()) {
    if (variable.causality != Causality::input) continue;
    std::visit(
        [&](auto* value) {
          using Value = std::remove_cvref_t<decltype(*value)>;
          if constexpr (std::is_same_v<Value, bool>) {
            *value = *values++ != 0.0;
          } else if constexpr (!std::is_same_v<Value, std::string>) {
            *value = static_cast<Value>(*values++);
          }
        },
        variable.value);
  }
}

void Component::step(double time_s, double duration_s) {
  if (!started_) throw std::invalid_argument("a step before the end of the initialisation");
  if (!(duration_s > 0.0) || !std::isfinite(duration_s)) {
    throw std::invalid_argument("a step of " + std::to_string(duration_s) + " s: give a finite duration > 0");
  }
  constexpr double slack_s = 1e-6;
  if (std::abs(time_s - time_s_) > slack_s) {
    throw std::invalid_argument("a step from " + std::to_string(time_s) + " s, but the last one ended at " +
                                std::to_string(time_s_) + " s");
  }
  for (const Variable& variable : model_->variables()) {
    if (variable.causality == Causality::input) check(variable);
  }
  const std::vector<double> given = inputs();
  model_->step(duration_s);
  steps_.push_back(duration_s);
  steps_.insert(steps_.end(), given.begin(), given.end());
  time_s_ += duration_s;
}

State Component::state() const {
  State state{.started = started_, .start_s = start_s_, .steps = steps_};
  for (const Variable& variable : model_->variables()) {
    if (variable.causality != Causality::output) state.values.push_back(text_of(variable));
  }
  return state;
}

void Component::restore(const State& state) {
  const std::size_t width = 1 + input_count_;
  if (state.values.size() != first_values_.size() || state.steps.size() % width != 0) {
    throw std::invalid_argument("the state belongs to another FMU");
  }
  const auto set_values = [&](const std::vector<std::string>& values) {
    std::size_t place = 0;
    for (const Variable& variable : model_->variables()) {
      if (variable.causality != Causality::output) set_text(variable, values[place++]);
    }
  };
  started_ = false;
  steps_.clear();
  set_values(state.values);
  start_s_ = state.start_s;
  if (!state.started) return;
  start();
  for (std::size_t at = 0; at < state.steps.size(); at += width) {
    set_inputs(state.steps.data() + at + 1);
    step(time_s_, state.steps[at]);
  }
  set_values(state.values);
}

void Component::reset() { restore({.values = first_values_}); }

void Component::log(bool error, const std::string& text) const {
  if (logger_) logger_(error, text);
}

}  // namespace abs_hil::interchange::fmu
