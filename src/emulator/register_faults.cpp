#include "emulator/register_faults.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "emulator/fault_text.hpp"

namespace abs_hil::emulator {

namespace {

struct RegisterFaultKind {
  std::string_view name;
  FaultKind kind;
  double least{1.0};  ///< of the parameter; above `most`: it takes none
  double most{0.0};
};
constexpr std::array<RegisterFaultKind, 8> register_faults{{{"ok", FaultKind::ok},
                                                            {"stuck", FaultKind::stuck},
                                                            {"wrong", FaultKind::wrong, -2147483648.0, 2147483648.0},
                                                            {"slow", FaultKind::slow, 0.0, 10e6},
                                                            {"delayed", FaultKind::delayed, 1.0, 1e5},
                                                            {"intermittent", FaultKind::intermittent, 0.0, 1.0},
                                                            {"off", FaultKind::off},
                                                            {"garbage", FaultKind::garbage}}};
constexpr std::string_view valid_register_fault =
    "OFFSET:KIND, OFFSET a multiple of 4 in hexadecimal below 100, KIND one of ok, stuck, wrong=ADDEND, slow=US, "
    "delayed=READS, intermittent=PROBABILITY, off, garbage";

std::optional<std::uint32_t> offset_in(std::string_view digits) {
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  const auto offset = number_in<std::uint32_t>(digits, 16);
  return offset && *offset < CardModel::bytes && *offset % 4 == 0 ? offset : std::nullopt;
}

}  // namespace

void FaultyCard::set(std::uint32_t offset, const Fault& fault) {
  faults_.erase(offset);
  if (fault.kind != FaultKind::ok) faults_[offset] = {.fault = fault, .stuck_at = card_.read32(offset)};
}

void FaultyCard::set(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) refuse_fault(text, valid_register_fault);
  const std::optional<std::uint32_t> offset = offset_in(text.substr(0, colon));
  if (!offset) refuse_fault(text, valid_register_fault);
  std::string_view name = text.substr(colon + 1);
  std::optional<double> parameter;
  if (const std::size_t equals = name.find('='); equals != std::string_view::npos) {
    parameter = number_in<double>(name.substr(equals + 1));
    if (!parameter) refuse_fault(text, valid_register_fault);
    name = name.substr(0, equals);
  }
  const auto known = std::ranges::find(register_faults, name, &RegisterFaultKind::name);
  if (known == register_faults.end() || (known->least <= known->most) != parameter.has_value()) {
    refuse_fault(text, valid_register_fault);
  }
  if (parameter && !(*parameter >= known->least && *parameter <= known->most)) {
    refuse_fault(text, valid_register_fault);
  }
  set(*offset, {.kind = known->kind, .parameter = parameter.value_or(0.0)});
}

bool FaultyCard::fails(const Fault& fault) {
  using enum FaultKind;
  if (fault.kind == off) return true;
  return fault.kind == intermittent && static_cast<double>(random_() >> 11U) * 0x1p-53 < fault.parameter;
}

AccessResult FaultyCard::read32(std::uint32_t offset) {
  using enum FaultKind;
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
  if (all_ones_) return {};  // the card is not on the bus: the write is lost
  AccessResult result;
  if (const auto found = faults_.find(offset); found != faults_.end()) {
    const Fault& fault = found->second.fault;
    if (fails(fault)) return {.failed = true};
    if (fault.kind == FaultKind::stuck) return {};
    if (fault.kind == FaultKind::slow) result.delay_ns = static_cast<std::int64_t>(fault.parameter * 1e3);
  }
  card_.write32(offset, value);
  return result;
}

}  // namespace abs_hil::emulator
