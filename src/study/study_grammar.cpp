#include "study/study_grammar.hpp"

namespace abs_hil::study {

namespace {

using config::Field;
using config::Grammar;
using config::Quantity;
using config::Shape;

constexpr rig::Range anything = rig::between(-1e15, 1e15);
constexpr rig::Range seeds = rig::from_zero(9e15);

Field row(Shape shape, const rig::OptionFacts& facts, const Grammar* grammar = nullptr) {
  return {.facts = facts, .shape = shape, .quantity = Quantity::none, .grammar = grammar};
}

Field row(Shape shape, rig::OptionFacts facts, Quantity quantity) {
  facts.unit = config::unit_of(quantity);
  return {.facts = facts, .shape = shape, .quantity = quantity};
}

Field required(Field field) {
  field.required = true;
  return field;
}

}  // namespace

const Grammar& study_grammar() {
  static const Grammar grammar{
      "the study",
      "A study of abs_hil (docs/studies.md)",
      {
          row(Shape::text, {.key = "description", .meaning = "what the study is for, in a line"}),
          row(Shape::texts, {.key = "plants", .meaning = "simulated plants: names or TOML files"}),
          row(Shape::texts, {.key = "experiments", .meaning = "experiments: names or TOML files"}),
          row(Shape::texts, {.key = "controllers", .meaning = "controllers, each as after compare --controllers"}),
          row(Shape::text, {.key = "model", .meaning = "every controller's model; without: the plant"}),
          row(Shape::choice, {.key = "model_follows",
                              .meaning = "what the controllers know of factors of the plant: nothing, or their values",
                              .allowed = {"nominal", "factors"}}),
          row(Shape::whole, {.key = "chunk",
                             .meaning = "runs in one file of results: what an interruption can lose",
                             .range = rig::between(1, 1'000'000)}),
          row(Shape::settings, {.key = "settings", .meaning = "configuration values of all runs"}),
          row(Shape::table, {.key = "design", .meaning = "how points are spread over the ranges of the factors"},
              &design_grammar()),
          row(Shape::table, {.key = "repeat", .meaning = "every point is run on several varied plants"},
              &repeat_grammar()),
          row(Shape::tables, {.key = "metric", .meaning = "figures made of signals, beside those of every run"},
              &metric_grammar()),
          row(Shape::grid, {.key = "factors", .meaning = "configuration values in which the runs differ"}),
      }};
  return grammar;
}

const Grammar& design_grammar() {
  static const Grammar grammar{
      "[design]",
      "How points are spread over the ranges of the factors",
      {
          required(
              row(Shape::choice, {.key = "kind",
                                  .meaning = "random, sobol, latin-hypercube, saltelli (for Sobol indices), or grid",
                                  .allowed = {"grid", "random", "sobol", "latin-hypercube", "saltelli"}})),
          row(Shape::whole, {.key = "points", .meaning = "how many points", .range = rig::between(1, 1e10)}),
          row(Shape::whole, {.key = "seed", .meaning = "seed of the design; without: 1", .range = seeds}),
      }};
  return grammar;
}

const Grammar& repeat_grammar() {
  static const Grammar grammar{
      "[repeat]",
      "Every point is run on several varied plants, the same for all points and controllers",
      {
          required(
              row(Shape::whole, {.key = "runs", .meaning = "how many varied plants", .range = rig::between(1, 1e9)})),
          row(Shape::text, {.key = "vary", .meaning = "what varies, as after compare --vary"}),
          row(Shape::whole, {.key = "seed", .meaning = "seed of the varied plants; without: 1", .range = seeds}),
      }};
  return grammar;
}

const Grammar& metric_grammar() {
  static const Grammar grammar{
      "[[metric]]",
      "One number made of a signal's values in a phase",
      {
          required(row(Shape::text, {.key = "name", .meaning = "of its column in the results"})),
          required(row(Shape::text, {.key = "of", .meaning = "a column of a run's CSV, or a controller's signal"})),
          required(row(Shape::choice, {.key = "take",
                                       .meaning = "what is made of the values",
                                       .allowed = {"max", "min", "mean", "rms", "last"}})),
          row(Shape::choice, {.key = "phase",
                              .meaning = "in which kind of phase; without: brake",
                              .allowed = {"accelerate", "coast", "brake", "hold", "stopped"}}),
          row(Shape::number,
              {.key = "after", .meaning = "from this time after its begin on", .range = rig::from_zero(600)},
              Quantity::time),
          row(Shape::number,
              {.key = "above", .meaning = "only while the car is faster than this", .range = rig::from_zero(200)},
              Quantity::speed),
      }};
  return grammar;
}

const Grammar& range_grammar() {
  static const Grammar grammar{
      "a range of values",
      "Equally spaced values with steps, a uniform or a normal range without",
      {
          row(Shape::number, {.key = "from", .meaning = "one end", .range = anything}),
          row(Shape::number, {.key = "to", .meaning = "the other end", .range = anything}),
          row(Shape::whole, {.key = "steps", .meaning = "how many values", .range = rig::between(2, 1e6)}),
          row(Shape::choice,
              {.key = "scale", .meaning = "what is uniform: the value or its logarithm", .allowed = {"linear", "log"}}),
          row(Shape::number, {.key = "mean", .meaning = "mean of a normal range", .range = anything}),
          row(Shape::number,
              {.key = "sd", .meaning = "standard deviation of a normal range", .range = rig::positive(1e15)}),
          row(Shape::number, {.key = "least", .meaning = "where a normal range is cut off", .range = anything}),
          row(Shape::number, {.key = "most", .meaning = "where a normal range is cut off", .range = anything}),
      }};
  return grammar;
}

}  // namespace abs_hil::study
