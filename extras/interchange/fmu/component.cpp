// An FMU's instance: parameters, steps, saved states.
#include "interchange/fmu/component.hpp"

#include <cmath>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "rig/formatted_text.hpp"

namespace abs_hil::interchange::fmu {

namespace {

std::string_view kind_in(const std::string& token) {
  for (const std::string_view kind : {plant_kind, controller_kind}) {
    if (token.starts_with("abs_hil-" + std::string(kind) + '-')) return kind;
  }
  return {};
}

constexpr std::string_view state_mark = "abs_hil state 2\n";

void exchange_text(rig::StateBytes& bytes, std::string& text) {
  std::vector<char> characters(text.begin(), text.end());
  bytes(characters);
  text.assign(characters.begin(), characters.end());
}

}  // namespace

std::string to_bytes(const State& state) {
  rig::StateBytes end;
  std::uint64_t sum = rig::hash_of(state);  // finds damage, no ill will
  end(sum);
  return std::string(state_mark) + state + end.written();
}

State state_of(const std::string& bytes) {
  constexpr std::size_t around = state_mark.size() + sizeof(std::uint64_t);
  if (bytes.size() < around || !bytes.starts_with(state_mark)) {
    throw std::invalid_argument("not a serialised state of this FMU");
  }
  State state = bytes.substr(state_mark.size(), bytes.size() - around);
  if (to_bytes(state) != bytes) throw std::invalid_argument("the serialised state is cut short or damaged");
  return state;
}

Component::Component(const std::string& token, const std::filesystem::path& resources, Logger logger)
    : token_(token), model_(make_model(kind_in(token))), logger_(std::move(logger)) {
  if (!model_ || token != token_of(kind_in(token), *model_)) {
    throw std::invalid_argument("the description (token " + token +
                                ") does not belong to this binary; export the FMU again");
  }
  const std::string path = (resources / "start.txt").string();
  std::ifstream file(resources / "start.txt");
  if (!file) throw std::invalid_argument("cannot read the parameters in " + path);
  std::string line;
  for (const Variable& variable : model_->variables()) {
    if (variable.causality != Causality::parameter) continue;
    const std::string key = variable.name + '=';
    if (!std::getline(file, line) || !line.starts_with(key)) {
      throw std::invalid_argument(path + " does not name " + variable.name + " where it should");
    }
    set_text(variable, line.substr(key.size()));
  }
  first_ = state();
}

const Variable& Component::variable(std::uint32_t reference) const {
  if (reference < 1 || reference > model_->variables().size()) {
    throw std::invalid_argument("value reference " + std::to_string(reference) + " is unknown");
  }
  return model_->variables()[reference - 1];
}

const Variable& Component::to_set(std::uint32_t reference) {
  const Variable& found = variable(reference);
  if (found.causality == Causality::output) throw std::invalid_argument(found.name + " is an output; it cannot be set");
  if (found.causality == Causality::parameter && started_) {
    if (!model_->tunable(found)) {
      throw std::invalid_argument(found.name + " is a fixed parameter; set it before the initialisation ends");
    }
    model_->tuned(found);
  }
  return found;
}

void Component::start() {
  for (const Variable& variable : model_->variables()) check(variable);
  model_->start(start_s_);
  started_ = true;
  time_s_ = start_s_;
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
    if (variable.causality == Causality::input || model_->tunable(variable)) check(variable);
  }
  model_->step(duration_s);
  time_s_ += duration_s;
}

void Component::exchange_state(rig::StateBytes& bytes) {
  std::string token = token_;
  exchange_text(bytes, token);
  if (token != token_) throw std::invalid_argument("the state belongs to another FMU");
  bool started = started_;
  bytes(started, start_s_);
  started_ = false;  // until all of it is read
  for (const Variable& variable : model_->variables()) {
    if (variable.causality == Causality::output) continue;
    const std::string now = text_of(variable);
    std::string text = now;
    exchange_text(bytes, text);
    if (text != now) set_text(variable, text);
  }
  if (started) {
    if (bytes.reads()) start();
    model_->exchange_state(bytes);
    bytes(time_s_);
  }
  bytes.end();
  started_ = started;
}

State Component::state() {
  rig::StateBytes bytes;
  exchange_state(bytes);
  return bytes.written();
}

void Component::restore(const State& state) {
  rig::StateBytes bytes(state);
  exchange_state(bytes);
}

void Component::reset() { restore(first_); }

void Component::log(bool error, const std::string& text) const {
  if (logger_) logger_(error, text);
}

}  // namespace abs_hil::interchange::fmu
