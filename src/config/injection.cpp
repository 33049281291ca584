// Reads the text of injected faults.
#include "config/injection.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <stdexcept>

#include "rig/formatted_text.hpp"

namespace abs_hil::config {

namespace {

constexpr std::array<std::string_view, injection_signal_count> signals{
    "encoder_upper", "encoder_lower", "encoders",  "stamp",     "supply", "temperature",
    "trip",          "read",          "motor_pwm", "brake_pwm", "enable", "write"};
constexpr std::array<std::string_view, injection_kind_count> kinds{"ok",    "off",  "stuck",   "garbage",
                                                                   "wrong", "slow", "delayed", "intermittent"};
constexpr std::string_view any_phase = "any";
constexpr std::array<std::string_view, 7> phases{"idle", "accelerate", "coast", "brake", "hold", "stopped", any_phase};
static_assert(phases[static_cast<std::size_t>(rig::Phase::stopped)] == rig::name_of(rig::Phase::stopped));
constexpr double longest_delay_s = 600.0;
/// Longest delay of `delayed` and `slow`; the memory suffices for it at 10 kHz.
constexpr double longest_holding_s = 0.5;

std::string listed(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text.append(text.empty() ? "" : " ").append(name);
  return text;
}

[[noreturn]] void refuse(std::string_view text, std::string_view part, const std::string& valid) {
  throw std::invalid_argument("injection \"" + std::string(text) + "\": \"" + std::string(part) + "\": " + valid +
                              "; write PHASE@SIGNAL:KIND[=PARAMETER][+DELAY][~DURATION], as in "
                              "brake@encoder_upper:stuck+0.2s");
}

bool reads_number(std::string_view text, double& value) {
  const auto number = rig::parse_number<double>(text);
  value = number.value_or(value);
  return number && std::isfinite(*number);
}

/// Parses "0.2s" or "200ms".
bool reads_time(std::string_view text, double& seconds) {
  const bool milli = text.ends_with("ms");
  if (!text.ends_with('s') || !reads_number(text.substr(0, text.size() - (milli ? 2 : 1)), seconds)) return false;
  if (milli) seconds *= 1e-3;
  return true;
}

/// Parameter of a kind on a signal: its range and its default.
struct Parameter {
  enum class Unit : std::uint8_t { none, number, time } unit{Unit::none};
  double least{0.0};
  double most{0.0};
  double otherwise{0.0};
};

Parameter parameter_of(InjectionSignal signal, InjectionKind kind) {
  using enum InjectionSignal;
  switch (kind) {
    case InjectionKind::slow:
      // A slow call delays the cycle; a slow signal is only updated at this interval.
      if (signal == read || signal == write) return {Parameter::Unit::time, 1e-6, longest_holding_s, 0.002};
      return {Parameter::Unit::time, 1e-6, longest_holding_s, 0.05};
    case InjectionKind::delayed: return {Parameter::Unit::time, 1e-6, longest_holding_s, 0.05};
    case InjectionKind::intermittent: return {Parameter::Unit::number, 1e-6, 1.0, 0.5};
    case InjectionKind::wrong:
      if (signal == encoder_upper || signal == encoder_lower) return {Parameter::Unit::number, -10.0, 10.0, -1.0};
      if (signal == stamp) return {Parameter::Unit::number, -10.0, 10.0, 2.0};
      if (signal == temperature) return {Parameter::Unit::number, -300.0, 300.0, 100.0};
      if (signal == supply || signal == motor_pwm || signal == brake_pwm || signal == write) {
        return {Parameter::Unit::number, 0.0, 10.0, 0.5};
      }
      return {};
    default: return {};
  }
}

std::size_t place_in(std::string_view text, std::string_view part, std::span<const std::string_view> names,
                     const char* what) {
  const auto found = std::ranges::find(names, part);
  if (found == names.end()) refuse(text, part, std::string("not a ") + what + "; known: " + listed(names));
  return static_cast<std::size_t>(found - names.begin());
}

/// Cuts off and returns what follows the last `mark`; nothing if there is none.
std::optional<std::string_view> cut(std::string_view& rest, char mark) {
  const std::size_t at = rest.rfind(mark);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view tail = rest.substr(at + 1);
  rest = rest.substr(0, at);
  return tail;
}

void read_parameter(std::string_view text, const std::optional<std::string_view>& given, Injection& injection) {
  const Parameter wanted = parameter_of(injection.signal, injection.kind);
  injection.parameter = wanted.otherwise;
  if (!given) return;
  const std::string what = std::string(name_of(injection.signal)) + ':' + std::string(name_of(injection.kind));
  if (wanted.unit == Parameter::Unit::none) refuse(text, *given, what + " takes no parameter");
  const bool time = wanted.unit == Parameter::Unit::time;
  const bool known = time ? reads_time(*given, injection.parameter) : reads_number(*given, injection.parameter);
  if (!known || injection.parameter < wanted.least || injection.parameter > wanted.most) {
    refuse(text, *given,
           what + rig::formatted(" takes a %s in [%g, %g]%s", time ? "time" : "number", wanted.least, wanted.most,
                                 time ? " s, as 0.05s or 50ms" : ""));
  }
}

}  // namespace

std::string_view name_of(InjectionSignal signal) noexcept { return signals[static_cast<std::size_t>(signal)]; }
std::string_view name_of(InjectionKind kind) noexcept { return kinds[static_cast<std::size_t>(kind)]; }

Injection parse_injection(std::string_view text) {
  Injection injection;
  std::string_view rest = text;
  if (const auto duration = cut(rest, '~')) {
    if (!reads_time(*duration, injection.duration_s) || injection.duration_s <= 0.0) {
      refuse(text, *duration, "not a duration above 0, as 0.5s or 500ms");
    }
  }
  if (const auto delay = cut(rest, '+')) {
    if (!reads_time(*delay, injection.delay_s) || injection.delay_s < 0.0 || injection.delay_s > longest_delay_s) {
      refuse(text, *delay, "not a delay in [0, 600] s, as 0.2s or 200ms");
    }
  }
  const auto parameter = cut(rest, '=');
  const auto kind = cut(rest, ':');
  if (!kind) refuse(text, rest, "no \":KIND\"; known: " + listed(kinds));
  const auto signal = cut(rest, '@');
  if (!signal) refuse(text, rest, "no \"PHASE@\" before the signal");
  const std::size_t phase = place_in(text, rest, phases, "phase");
  if (phases[phase] != any_phase) injection.phase = static_cast<rig::Phase>(phase);
  injection.signal = static_cast<InjectionSignal>(place_in(text, *signal, signals, "signal"));
  injection.kind = static_cast<InjectionKind>(place_in(text, *kind, kinds, "kind"));
  read_parameter(text, parameter, injection);
  return injection;
}

std::vector<Injection> parse_injections(std::string_view list) {
  constexpr std::string_view separators = ", \t";
  std::vector<Injection> injections;
  for (std::size_t at = list.find_first_not_of(separators); at != std::string_view::npos;
       at = list.find_first_not_of(separators, at)) {
    const std::size_t end = std::min(list.find_first_of(separators, at), list.size());
    injections.push_back(parse_injection(list.substr(at, end - at)));
    at = end;
  }
  return injections;
}

std::string to_text(const Injection& injection) {
  const Parameter parameter = parameter_of(injection.signal, injection.kind);
  std::string text(injection.phase ? rig::name_of(*injection.phase) : any_phase);
  text += '@' + std::string(name_of(injection.signal)) + ':' + std::string(name_of(injection.kind));
  if (parameter.unit != Parameter::Unit::none) {
    text += rig::formatted(parameter.unit == Parameter::Unit::time ? "=%.15gs" : "=%.15g", injection.parameter);
  }
  if (injection.delay_s > 0.0) text += rig::formatted("+%.15gs", injection.delay_s);
  if (std::isfinite(injection.duration_s)) text += rig::formatted("~%.15gs", injection.duration_s);
  return text;
}

}  // namespace abs_hil::config
