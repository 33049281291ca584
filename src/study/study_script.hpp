#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "config/script.hpp"
#include "study/design.hpp"
#include "study/factor.hpp"
#include "study/signal_metrics.hpp"
#include "study/variation.hpp"

namespace abs_hil::study {

/// A study as read from its file (docs/studies.md). It is checked by itself, but not yet against plants and
/// experiments.
struct StudyScript {
  std::string path{};  ///< its name in errors
  std::string text{};  ///< of the file, byte by byte
  std::string description{};
  std::vector<std::string> plants{"paper-table1"};
  std::vector<std::string> experiments{"paper"};
  std::optional<std::string> model{};
  bool model_follows_factors{false};  ///< else the model is the plant's before factors and variation change that
  std::vector<std::string> controllers{"adaptive"};
  std::uint64_t chunk{1000};  ///< runs in one file of results
  DesignKind design{DesignKind::grid};
  std::uint64_t points{1};
  std::uint64_t design_seed{1};
  std::uint64_t repeat{1};
  std::uint64_t repeat_seed{1};
  Variation variation{};
  std::vector<config::Setting> settings{};
  std::vector<SignalMetric> metrics{};  ///< of its own, beside those of every run
  std::vector<Factor> factors{};        ///< in the order of the file
};

/// Reads a study. Throws config::ConfigError with one line, "FILE:LINE:COLUMN: ...", which names the error and what is
/// valid. @param path  the study's name in errors
[[nodiscard]] StudyScript parse_study(std::string text, std::string path);

/// The study of that file. Throws config::ConfigError.
[[nodiscard]] StudyScript load_study(const std::string& path);

}  // namespace abs_hil::study
