// The rules of a study's file that concern several keys at once.
#include "study/study_script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "config/config_error.hpp"
#include "config/reader.hpp"
#include "rig/error_words.hpp"

namespace abs_hil::study {

namespace {

using config::TableReader;

constexpr std::array<std::string_view, 5> factor_tables{"plant.", "model.", "control.", "experiment.", "gate."};
/// They choose what a run is, which the study's own keys do.
constexpr std::array<std::string_view, 3> not_factors{"experiment.name", "control.controller",
                                                      "experiment.wait_for_start"};

bool may_be_factor(const std::string& key) {
  return std::ranges::find(not_factors, key) == not_factors.end() &&
         std::ranges::any_of(factor_tables, [&key](std::string_view table) { return key.starts_with(table); });
}

/// Carries out `act`; an std::invalid_argument becomes an error at the key.
template <class Act>
void refuse_at(const TableReader& reader, std::string_view key, const Act& act) try {
  act();
} catch (const std::invalid_argument& error) {
  reader.fail(reader.find(key)->place, error.what());
}

void check_design(const DesignScript& design, bool given, bool ranges, const TableReader& reader) {
  if (!given) {
    if (!ranges) return;
    reader.fail(reader.find("factors")->place,
                "the factors have ranges, and the study no [design]; give kind and points in [design], or steps in "
                "each range");
  }
  const bool is_grid = design.kind == DesignKind::grid;
  if (is_grid && (ranges || design.has_points)) {
    reader.fail(design.place,
                "a grid has no points of its own; give steps in each range of [factors] and leave points out, or "
                "another kind of design");
  }
  if (!is_grid && !ranges) {
    reader.fail(design.place,
                "no factor has a range, so the design has nothing to spread; give { from, to } or { mean, sd } in "
                "[factors], or leave [design] out");
  }
  if (!is_grid && !design.has_points) {
    reader.fail(design.place, "[design] has no \"points\" (how many points); give them");
  }
}

}  // namespace

void SignalMetric::check(const TableReader& reader) {
  place = reader.find("of")->place;
  if (!rig::is_signal_name(name)) {
    reader.fail(reader.find("name")->place,
                fmt::format("name = \"{}\": give letters, digits and _, a letter first, at most 32", name));
  }
}

void DesignScript::check(const TableReader& reader) { has_points = reader.find("points") != nullptr; }

void RepeatScript::check(const TableReader& reader) {
  variation = Variation::standard();
  if (reader.find("vary") != nullptr) refuse_at(reader, "vary", [this] { variation = Variation::parse(vary); });
}

void StudyScript::check(const TableReader& reader) {
  std::vector<std::string> all;
  refuse_at(reader, "controllers", [&] {
    for (const std::string& names : controllers) {
      for (std::string& one : split_contenders(names)) all.push_back(std::move(one));
    }
  });
  controllers = std::move(all);
  for (const Factor& factor : factors) {
    if (may_be_factor(factor.key)) continue;
    reader.fail(factor.place,
                fmt::format("{} cannot be a factor; factors are keys of plant, model, control, experiment and gate; "
                            "plants, experiments and controllers are lists of the study",
                            factor.key));
  }
  check_design(design, reader.find("design") != nullptr, std::ranges::any_of(factors, &Factor::has_range), reader);
}

StudyScript parse_study(std::string text, std::string path) {
  StudyScript script;
  script.path = path;
  script.text = std::move(text);
  const config::Source source(std::move(path));
  config::read_table(source, source.parsed(script.text), {1, 1}, script);
  return script;
}

StudyScript load_study(const std::string& path) {
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  if (const int why = errno; !std::filesystem::is_regular_file(path, error) || !file) {
    throw config::ConfigError(path + ": " +
                              (file || why == ENOENT ? "no such file; give a study, a TOML file (docs/studies.md)"
                                                     : rig::refusal(why, path, rig::reading)));
  }
  return parse_study({std::istreambuf_iterator<char>(file), {}}, path);
}

}  // namespace abs_hil::study
