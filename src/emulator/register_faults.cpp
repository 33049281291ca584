#include "abs_hil/emulator/register_faults.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace abs_hil::emulator {

namespace {

using enum FaultKind;
constexpr std::array<std::pair<std::string_view, FaultKind>, 8> kinds{{{"ok", ok},
                                                                       {"stuck", stuck},
                                                                       {"wrong", wrong},
                                                                       {"slow", slow},
                                                                       {"delayed", delayed},
                                                                       {"intermittent", intermittent},
                                                                       {"off", off},
                                                                       {"garbage", garbage}}};

[[noreturn]] void refuse(std::string_view text) {
  throw std::invalid_argument("fault \"" + std::string(text) +
                              "\": give OFFSET:KIND, OFFSET a multiple of 4 in hexadecimal below 100, KIND one of ok, "
                              "stuck, wrong=ADDEND, slow=US, delayed=READS, intermittent=PROBABILITY, off, garbage");
}

std::uint32_t offset_in(std::string_view digits, std::string_view whole) {
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  std::uint32_t offset = 0;
  const auto [at, error] = std::from_chars(digits.data(), digits.data() + digits.size(), offset, 16);
  const bool valid =
      error == std::errc() && at == digits.data() + digits.size() && offset < CardModel::bytes && offset % 4 == 0;
  if (!valid) refuse(whole);
  return offset;
}

bool takes_parameter(FaultKind kind) {
  return kind == wrong || kind == slow || kind == delayed || kind == intermittent;
}

bool in_range(const Fault& fault) {
  switch (fault.kind) {
    case wrong: return std::abs(fault.parameter) <= 2147483648.0;
    case slow: return fault.parameter >= 0.0 && fault.parameter <= 10e6;
    case delayed: return fault.parameter >= 1.0 && fault.parameter <= 1e5;
    case intermittent: return fault.parameter >= 0.0 && fault.parameter <= 1.0;
    default: return true;
  }
}

}  // namespace

void FaultyCard::set(std::uint32_t offset, const Fault& fault) {
  faults_.erase(offset);
  if (fault.kind != ok) faults_[offset] = {.fault = fault, .stuck_at = card_.read32(offset)};
}

void FaultyCard::set(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) refuse(text);
  const std::uint32_t offset = offset_in(text.substr(0, colon), text);
  std::string_view name = text.substr(colon + 1);
  std::optional<double> parameter;
  if (const std::size_t equals = name.find('='); equals != std::string_view::npos) {
    const std::string_view number = name.substr(equals + 1);
    double value = 0.0;
    const auto [at, error] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (error != std::errc() || at != number.data() + number.size()) refuse(text);
    parameter = value;
    name = name.substr(0, equals);
  }
  for (const auto& [known, kind] : kinds) {
    if (known != name) continue;
    const Fault fault{.kind = kind, .parameter = parameter.value_or(0.0)};
    if (takes_parameter(kind) != parameter.has_value() || !in_range(fault)) refuse(text);
    set(offset, fault);
    return;
  }
  refuse(text);
}

bool FaultyCard::fails(const Fault& fault) {
  if (fault.kind == off) return true;
  return fault.kind == intermittent && static_cast<double>(random_() >> 11U) * 0x1p-53 < fault.parameter;
}

AccessResult FaultyCard::read32(std::uint32_t offset) {
  if (all_ones_) return {.value = ~0U};
  AccessResult result{.value = card_.read32(offset)};
  const auto found = faults_.find(offset);
  if (found == faults_.end()) return result;
  State& state = found->second;
  if (fails(state.fault)) return {.failed = true};
  switch (state.fault.kind) {
    case stuck: result.value = state.stuck_at; break;
    case wrong: result.value += static_cast<std::uint32_t>(static_cast<std::int64_t>(state.fault.parameter)); break;
    case slow: result.delay_ns = static_cast<std::int64_t>(state.fault.parameter * 1e3); break;
    case garbage: result.value = static_cast<std::uint32_t>(random_() >> 32U); break;
    case delayed:
      state.earlier.push_back(result.value);
      result.value = state.earlier.front();
      if (static_cast<double>(state.earlier.size()) > state.fault.parameter) state.earlier.pop_front();
      break;
    default: break;
  }
  return result;
}

AccessResult FaultyCard::write32(std::uint32_t offset, std::uint32_t value) {
  if (all_ones_) return {};  // nobody is there to take it
  AccessResult result;
  if (const auto found = faults_.find(offset); found != faults_.end()) {
    const Fault& fault = found->second.fault;
    if (fails(fault)) return {.failed = true};
    if (fault.kind == stuck) return {};
    if (fault.kind == slow) result.delay_ns = static_cast<std::int64_t>(fault.parameter * 1e3);
  }
  card_.write32(offset, value);
  return result;
}

}  // namespace abs_hil::emulator
