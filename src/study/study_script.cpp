#include "study/study_script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "config/config_error.hpp"
#include "config/reader.hpp"
#include "rig/parse_toml.hpp"
#include "study/contender.hpp"
#include "study/factor_reader.hpp"
#include "study/study_grammar.hpp"

namespace abs_hil::study {

namespace {

using config::Entry;
using config::Source;
using config::TableReader;

constexpr std::array<std::pair<std::string_view, DesignKind>, 5> design_names{{
    {"grid", DesignKind::grid},
    {"random", DesignKind::random},
    {"sobol", DesignKind::sobol},
    {"latin-hypercube", DesignKind::latin_hypercube},
    {"saltelli", DesignKind::saltelli},
}};

constexpr std::array<std::pair<std::string_view, Reduction>, 5> reductions{{
    {"max", Reduction::max},
    {"min", Reduction::min},
    {"mean", Reduction::mean},
    {"rms", Reduction::rms},
    {"last", Reduction::last},
}};

std::uint64_t whole_or(const TableReader& reader, std::string_view name, std::uint64_t otherwise) {
  const Entry* entry = reader.find(name);
  return entry == nullptr ? otherwise : static_cast<std::uint64_t>(reader.whole(*entry));
}

std::vector<std::string> texts_or(const TableReader& reader, std::string_view name,
                                  std::vector<std::string> otherwise) {
  const Entry* entry = reader.find(name);
  return entry == nullptr ? otherwise : reader.texts(*entry);
}

class StudyParser {
 public:
  StudyParser(const Source& source, StudyScript& script) : source_(source), script_(script) {}

  void read(const toml::table& table) {
    const TableReader root(source_, table, study_grammar(), {1, 1});
    script_.description = root.text_or_empty("description");
    script_.plants = texts_or(root, "plants", script_.plants);
    script_.experiments = texts_or(root, "experiments", script_.experiments);
    if (const Entry* controllers = root.find("controllers")) read_controllers(root, *controllers);
    if (const Entry* model = root.find("model")) script_.model = root.text(*model);
    if (const Entry* follows = root.find("model_follows")) {
      script_.model_follows_factors = root.choice(*follows) == "factors";
    }
    script_.chunk = whole_or(root, "chunk", script_.chunk);
    script_.settings = read_settings(source_, root);
    if (const Entry* metrics = root.find("metric")) {
      for (const toml::table* metric : root.tables(*metrics)) read_metric(*metric, metrics->place);
    }
    if (const Entry* factors = root.find("factors")) script_.factors = read_factors(source_, root.table(*factors));
    read_design(root);
    if (const Entry* repeat = root.find("repeat")) read_repeat(root.table(*repeat), repeat->place);
  }

 private:
  void read_controllers(const TableReader& root, const Entry& entry) {
    std::vector<std::string> names = root.texts(entry);
    script_.controllers.clear();
    for (const std::string& name : names) {
      try {
        for (std::string& one : split_contenders(name)) script_.controllers.push_back(std::move(one));
      } catch (const std::invalid_argument& error) {
        source_.fail(entry.place, error.what());
      }
    }
  }

  void read_metric(const toml::table& table, config::Place place) {
    const TableReader reader(source_, table, metric_grammar(), place);
    SignalMetric metric{.name = reader.text(*reader.find("name")),
                        .of = reader.text(*reader.find("of")),
                        .place = reader.find("of")->place};
    if (!rig::is_signal_name(metric.name)) {
      source_.fail(reader.find("name")->place,
                   fmt::format("name = \"{}\": give letters, digits and _, a letter first, at most 32", metric.name));
    }
    const std::string take = reader.choice(*reader.find("take"));
    metric.take = std::ranges::find(reductions, take, [](const auto& row) { return row.first; })->second;
    if (const Entry* phase = reader.find("phase")) {
      const std::string name = reader.choice(*phase);
      for (const rig::Phase kind : {rig::Phase::accelerate, rig::Phase::coast, rig::Phase::hold, rig::Phase::stopped}) {
        if (rig::name_of(kind) == name) metric.phase = kind;
      }
    }
    metric.after_s = number_or_zero(reader, "after");
    metric.above_m_s = number_or_zero(reader, "above");
    script_.metrics.push_back(std::move(metric));
  }

  [[nodiscard]] double number_or_zero(const TableReader& reader, std::string_view name) const {
    const auto number = reader.optional_number(name);
    if (!number) return 0.0;
    if (!number->key.empty()) source_.fail(number->place, fmt::format("{}: give a number, not a $key", name));
    return number->value;
  }

  void read_design(const TableReader& root) {
    const bool ranges = std::ranges::any_of(script_.factors, &Factor::has_range);
    const Entry* design = root.find("design");
    if (design == nullptr) {
      if (!ranges) return;
      source_.fail(root.find("factors")->place,
                   "the factors have ranges, and the study no [design]; give kind and points in [design], or steps "
                   "in each range");
    }
    const TableReader reader(source_, root.table(*design), design_grammar(), design->place);
    const std::string kind = reader.choice(*reader.find("kind"));
    script_.design = std::ranges::find(design_names, kind, [](const auto& row) { return row.first; })->second;
    const Entry* points = reader.find("points");
    const bool is_grid = script_.design == DesignKind::grid;
    if (is_grid && (ranges || points != nullptr)) {
      source_.fail(design->place,
                   "a grid has no points of its own; give steps in each range of [factors] and leave "
                   "points out, or another kind of design");
    }
    if (!is_grid && !ranges) {
      source_.fail(design->place,
                   fmt::format("no factor has a range, so a design of kind {} has nothing to spread; "
                               "give {{ from, to }} or {{ mean, sd }} in [factors], or leave [design] out",
                               kind));
    }
    if (!is_grid && points == nullptr) {
      source_.fail(reader.place(), "[design] has no \"points\" (how many points); give them");
    }
    script_.points = whole_or(reader, "points", 1);
    script_.design_seed = whole_or(reader, "seed", 1);
  }

  void read_repeat(const toml::table& table, config::Place place) {
    const TableReader reader(source_, table, repeat_grammar(), place);
    script_.repeat = whole_or(reader, "runs", 1);
    script_.repeat_seed = whole_or(reader, "seed", 1);
    script_.variation = Variation::standard();
    if (const Entry* vary = reader.find("vary")) {
      try {
        script_.variation = Variation::parse(reader.text(*vary));
      } catch (const std::invalid_argument& error) {
        source_.fail(vary->place, error.what());
      }
    }
  }

  const Source& source_;
  StudyScript& script_;
};

}  // namespace

StudyScript parse_study(std::string text, std::string path) {
  StudyScript script{.path = path, .text = std::move(text)};
  const Source source(std::move(path));
  try {
    const toml::table table = rig::parse_toml(script.text, script.path);
    StudyParser(source, script).read(table);
  } catch (const toml::parse_error& problem) {
    source.fail(config::place_of(problem.source()), fmt::format("not valid TOML: {}", problem.description()));
  }
  return script;
}

StudyScript load_study(const std::string& path) {
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  if (!std::filesystem::is_regular_file(path, error) || !file) {
    throw config::ConfigError(
        fmt::format("{}: no such file, or it cannot be read; give a study, a TOML file (docs/studies.md)", path));
  }
  return parse_study({std::istreambuf_iterator<char>(file), {}}, path);
}

}  // namespace abs_hil::study
