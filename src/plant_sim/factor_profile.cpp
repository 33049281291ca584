// Reads profiles of factors, and follows a plant through one.
#include "abs_hil/plant_sim/factor_profile.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>

#include "abs_hil/plant_sim/drift.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::plant_sim {
namespace {

constexpr double highest_factor = 10.0;
/// Rounding error of the sum of a run's intervals; a piece with less time left has ended.
constexpr double time_rounding_s = 1e-11;

[[noreturn]] void refuse(std::string_view part, const std::string& problem) {
  throw std::invalid_argument("\"" + std::string(part) + "\" " + problem);
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  for (const std::string_view word : rig::split(text, ' ')) words.push_back(rig::trimmed(word));
  std::erase(words, std::string_view());
  return words;
}

double number(std::string_view word, std::string_view part) {
  const auto value = rig::parse_number<double>(word);
  if (!value || !std::isfinite(*value)) refuse(part, "holds \"" + std::string(word) + "\" instead of a number");
  return *value;
}

double factor(std::string_view word, std::string_view part) {
  const double value = number(word, part);
  if (!(value > 0.0 && value <= highest_factor)) refuse(part, "has a factor outside (0, 10]");
  return value;
}

struct Change {
  double begin;
  double end;
  double value;
};

Change change(std::string_view part) {
  const std::vector<std::string_view> words = words_of(part);
  if (words.size() == 3 && words[1] == "at") {
    const double at = number(words[2], part);
    return {at, at, factor(words[0], part)};
  }
  if (words.size() == 5 && words[1] == "from" && words[3] == "to") {
    const Change ramp{number(words[2], part), number(words[4], part), factor(words[0], part)};
    if (!(ramp.begin < ramp.end)) refuse(part, "must end after it begins");
    return ramp;
  }
  refuse(part,
         "is not a change; write \"VALUE at POSITION\" or \"VALUE from POSITION to POSITION\", as in \"0.5 at 0.8\"");
}

}  // namespace

FactorProfile::FactorProfile(std::string_view text, std::string_view key, Axes axes) try {
  const std::string_view whole = rig::trimmed(text);
  if (whole.empty()) return;
  const bool time_only = axes == Axes::time_only;
  const std::size_t colon = whole.find(':');
  if (colon == std::string_view::npos) {
    refuse(whole, time_only ? "names no axis; begin with \"time:\" or \"braking time:\""
                            : "names no axis; begin with \"time:\", \"distance:\", \"braking time:\" or "
                              "\"braking distance:\"");
  }
  const std::string_view head = rig::trimmed(whole.substr(0, colon));
  const std::vector<std::string_view> axis = words_of(head);
  from_braking_ = axis.size() == 2 && axis.front() == "braking";
  if ((axis.size() != 1 && !from_braking_) || (axis.back() != "time" && (axis.back() != "distance" || time_only))) {
    refuse(head, time_only ? "is not an axis of this profile; write time or braking time"
                           : "is not an axis; write time, distance, braking time or braking distance");
  }
  axis_ = axis.back() == "time" ? Axis::time : Axis::distance;

  std::vector<std::string_view> parts = rig::split(whole.substr(colon + 1), ';');
  for (std::string_view& part : parts) part = rig::trimmed(part);
  if (parts.size() > 1 && parts.back().empty()) parts.pop_back();
  pieces_.front().value = factor(parts.front(), parts.front());
  double jumped_at = 0.0;
  for (const std::string_view part : std::span(parts).subspan(1)) {
    const Change next = change(part);
    Piece& last = pieces_.back();
    if (next.begin < last.begin) refuse(part, "must not begin before the previous change has ended");
    const bool jump = next.begin == next.end;
    if (jump && next.begin == jumped_at) refuse(part, "must come after the previous jump and after 0");
    const double before = last.value;
    last.end = next.begin;
    if (last.end == last.begin) pieces_.pop_back();
    if (jump) {
      jumped_at = next.begin;
    } else {
      pieces_.push_back({next.begin, next.end, before, (next.value - before) / (next.end - next.begin)});
    }
    pieces_.push_back({.begin = next.end, .value = next.value});
  }
} catch (const std::invalid_argument& problem) {
  throw std::invalid_argument(std::string(key) + ": " + problem.what());
}

double FactorProfile::highest() const noexcept {
  double highest = 0.0;
  for (const Piece& piece : pieces_) highest = std::max(highest, piece.highest());
  return highest;
}

void FactorProgress::start(double angle2_rad) noexcept {
  index_ = 0;
  time_s_ = 0.0;
  origin_time_s_ = 0.0;
  origin_angle2_rad_ = angle2_rad;
  counting_ = !profile_.from_braking();
}

void FactorProgress::brake_applied(double angle2_rad) noexcept {
  if (counting_) return;
  counting_ = true;
  origin_time_s_ = time_s_;
  origin_angle2_rad_ = angle2_rad;
}

void FactorProgress::settle_on_changes(double angle2_rad) noexcept {
  if (!counting_) return;
  // The last piece ends at infinity. Along the distance this is the same comparison as in the integration.
  while (along_time() ? time_left_s() <= time_rounding_s : angle2_rad >= end_angle2_rad()) ++index_;
}

PresentFactor FactorProgress::present_of_changes(double angle2_rad) const noexcept {
  const FactorProfile::Piece& p = piece();
  PresentFactor now{.value = scale_ * p.value, .angle2_rad = angle2_rad, .highest = scale_ * p.highest()};
  if (!counting_) return now;
  if (p.slope != 0.0) {
    const double position = along_time() ? time_s_ - origin_time_s_ : r2_m_ * (angle2_rad - origin_angle2_rad_);
    now.value = scale_ * p.at(std::clamp(position, p.begin, p.end));
    (along_time() ? now.per_s : now.per_rad) = scale_ * (along_time() ? p.slope : p.slope * r2_m_);
  }
  if (!along_time()) now.end_angle2_rad = end_angle2_rad();
  return now;
}

}  // namespace abs_hil::plant_sim
