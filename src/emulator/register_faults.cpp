// Faults of single registers of the emulated PCI card.
#include <array>
#include <optional>

#include "emulator/card_model.hpp"
#include "emulator/fault_text.hpp"

namespace abs_hil::emulator {

namespace {

// In the order of FaultKind.
constexpr std::array<FaultName, 8> register_faults{{{"ok"},
                                                    {"stuck"},
                                                    {"wrong=ADDEND", -2147483648.0, 2147483648.0},
                                                    {"slow=US", 0.0, 10e6},
                                                    {"delayed=READS", 1.0, 1e5},
                                                    {"intermittent=PROBABILITY", 0.0, 1.0},
                                                    {"off"},
                                                    {"garbage"}}};

std::optional<std::uint32_t> offset_in(std::string_view digits) {
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  const auto offset = rig::parse_number<std::uint32_t>(digits, 16);
  return offset && *offset < CardModel::bytes && *offset % 4 == 0 ? offset : std::nullopt;
}

}  // namespace

void FaultyCard::set(std::uint32_t offset, const Fault& fault) {
  faults_.erase(offset);
  if (fault.kind != FaultKind::ok) faults_[offset] = {.fault = fault, .stuck_at = card_.read32(offset)};
}

void FaultyCard::set(std::string_view text) {
  const std::size_t colon = text.find(':');
  const auto offset = colon == std::string_view::npos ? std::nullopt : offset_in(text.substr(0, colon));
  const auto given = offset ? fault_in(text.substr(colon + 1), register_faults) : std::nullopt;
  if (!given) {
    refuse_fault(text, "OFFSET:KIND, OFFSET a multiple of 4 in hexadecimal below 100, KIND one of " +
                           usages_of(register_faults, ", "));
  }
  set(*offset, {.kind = static_cast<FaultKind>(given->place), .parameter = given->number});
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
