// The registry's entry for driver.kind=pci, and what the driver tells people.

#include <filesystem>

#include "driver/monotonic_time.hpp"
#include "driver/pci/pci_driver.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::pci {

namespace {

using rig::formatted;

std::unique_ptr<RigDriver> make_pci_driver(const PciOptions& options, const RunFacts& run) {
  PciOptions pci = options;
  pci.encoder_counts_per_rev = run.encoder_counts_per_rev;
  return std::make_unique<PciDriver>(
      pci, [pci, lock_step = run.lock_step] { return open_card(pci, lock_step); },
      run.lock_step ? nullptr : monotonic_ns);
}

bool is_of_the_kernel(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::weakly_canonical(file, error).string().starts_with("/sys/") || error;
}

/// Files of the kernel belong to real cards, even where driver.emulated says otherwise, and even behind links from
/// another folder. All other files are an emulator's.
BoardReality pci_reality(const PciOptions& options) {
  bool real = is_of_the_kernel(options.root);
  for (const FoundBoard& board : survey_cards(options)) real = real || is_of_the_kernel(board.files.front());
  if (!real) return {.reality = Reality::emulator};
  return {.reality = Reality::hardware,
          .option = "driver.pci.root = " + options.root,
          .is = "holds the real cards; give the emulator's folder"};
}

std::string converted(std::uint32_t offset, std::uint32_t raw, std::uint32_t velocity_period_ticks) {
  switch (offset) {
    case reg::supply:
    case reg::supply_min: return formatted("%.2f V", supply_V(raw));
    case reg::temperature_max: return formatted("%u deg C", raw);
    case reg::velocity_period: return formatted("%.4g s", static_cast<double>(raw) / board_clock_Hz);
    case reg::velocity_lower:
    case reg::velocity_upper:
    case reg::velocity_limit: return formatted("%.2f rad/s", velocity_rad_s(raw, velocity_period_ticks));
    default: return {};
  }
}

}  // namespace

Backend pci_backend() {
  return backend<PciOptions>({
      .name = "pci",
      .summary = "RT-DAC4/PCI with ABS logic; unverified on hardware",
      .not_verified = "The register map comes from the maker's documents and has been tested only with an emulator. Do "
                      "the checks of docs/rig-setup.md with abs_hil commission",
      .make_driver = make_pci_driver,
      .make_safe_state_writer = safe_state_writer_of,
      .outputs = pwm_grid<PciOptions>,
      .reality = pci_reality,
      .find = survey_cards,
      .free_options = {"root", "bdf", "bitstream", "plausible_speed_rad_s"},
  });
}

std::vector<std::string> PciDriver::notes() const {
  if (!card_.window) return {};
  const auto prescaler = static_cast<std::uint32_t>(options_.pwm_prescaler);
  std::vector<std::string> notes;
  notes.push_back("card " + card_.place + ": BAR 2, I/O ports, opened and locked");
  notes.push_back(
      formatted("bitstream version 0x%04x (%s), channel counts 0x%04x: %u counters, %u timers", version_ & low_16_bits,
                options_.bitstream >= 0 ? "as configured" : "not compared: driver.pci.bitstream is not set",
                channel_counts_ & low_16_bits, (channel_counts_ >> 12U) & 0xFU, (channel_counts_ >> 8U) & 0xFU));
  notes.push_back(formatted("PWM %s, prescaler %u: %.4g Hz; drive duty at most %.3g, brake duty at most %.3g",
                            options_.pwm_mode.c_str(), prescaler, pwm_frequency_Hz(mode_, prescaler),
                            options_.motor_duty_max, options_.brake_duty_max));
  notes.push_back(formatted("%zu register accesses a cycle (%zu reading, %zu writing), about 1 us each on PCI",
                            accesses_per_cycle, accesses_in_read, accesses_in_write));
  return notes;
}

std::vector<std::string> PciDriver::inspection() {
  if (!card_.window) return {};
  std::uint32_t period_ticks = 0;
  static_cast<void>(card_.window->read32(reg::velocity_period, period_ticks));  // 0 makes the velocities NaN
  std::vector<std::string> lines;
  for (const Register& entry : registers()) {
    std::uint32_t raw = 0;
    const IoResult result = card_.window->read32(entry.offset, raw);
    std::string line = formatted("%02X  %-34s", entry.offset, std::string(entry.name).c_str());
    line += result.ok() ? formatted("0x%08x  %-12s", raw, converted(entry.offset, raw, period_ticks).c_str())
                        : formatted("%-24s", error_text(result).c_str());
    line += formatted("%-14s", std::string(name_of(entry.standing)).c_str());
    line += std::string(entry.use);
    if (!entry.open.empty()) line += "; not known: " + std::string(entry.open);
    lines.push_back(std::move(line));
  }
  std::uint32_t high = 0;
  std::uint32_t low = 0;
  if (card_.window->read32(reg::temperature_high, high).ok() && card_.window->read32(reg::temperature_low, low).ok()) {
    lines.push_back(formatted("    temperature %.1f deg C", temperature_C(high, low)));
  }
  return lines;
}

}  // namespace abs_hil::driver::pci
