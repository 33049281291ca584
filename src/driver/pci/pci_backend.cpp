// The card's registers, the registry's entry for driver.kind=pci, and what the driver tells people.

#include <filesystem>
#include <numbers>

#include "driver/monotonic_time.hpp"
#include "driver/pci/pci_driver.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::pci {

using rig::formatted;

namespace {

using enum Standing;

// What the driver does with a register.
constexpr std::string_view never = "not used";
constexpr std::string_view checked = "read once";
constexpr std::string_view every_cycle = "every cycle";
constexpr std::string_view in_turn = "in turn";
constexpr std::string_view at_activation = "at activation";
constexpr std::string_view kept_in_turn = "at activation, then in turn";

constexpr std::string_view abs_only = "in the board's generic logic this is an ADC or DAC: check the bitstream first";
constexpr std::string_view limit_open = "whether the host may write it; its power-on value";

constexpr std::array table{
    Register{reg::bitstream_version, "bitstream version", "", "low 16 bits", documented, in_turn,
             "the version word of the ABS logic"},
    Register{reg::channel_counts, "channel counts", "", "bits 15:12 counters, 11:8 timers", documented, in_turn},
    Register{reg::supply, "supply", "V", "92000 / raw; 0 = none", documented, in_turn},
    Register{0x40, "digital I/O direction, low half", "", "a bit each", documented, never,
             "which lines the ABS logic uses"},
    Register{0x44, "digital I/O direction, high half", "", "a bit each", documented, never, "as the low half"},
    Register{0x48, "digital I/O value, low half", "", "a bit each", documented, never, "as direction"},
    Register{0x4C, "digital I/O value, high half", "", "a bit each", documented, never, "as direction"},
    Register{reg::velocity_period, "velocity period", "s", "raw / 40 MHz", documented, in_turn, "its power-on value"},
    Register{reg::velocity_lower, "velocity of the lower wheel", "rad/s",
             "low 16 bits; 2 pi raw (40 MHz / velocity period) / 1024", documented, checked,
             "how it shows backward motion"},
    Register{reg::velocity_upper, "velocity of the upper wheel", "rad/s", "as the lower wheel's", documented, checked,
             "as the lower wheel's"},
    Register{reg::velocity_limit, "overspeed limit", "rad/s", "as the velocities", documented, in_turn, limit_open},
    Register{reg::pwm_index, "PWM index", "", "0 drive, 1 brake: selects the PWM of 64, 68 and 6C", documented,
             every_cycle},
    Register{reg::pwm_mode, "PWM mode", "", "0 = 8-bit, 1 = 12-bit; reads back", documented, kept_in_turn},
    Register{reg::pwm_prescaler, "PWM prescaler", "", "f = 40 MHz / ((prescaler + 1) full width); reads back",
             documented, kept_in_turn, "how many bits it has"},
    Register{reg::pwm_width, "PWM width", "", "high time, 0 ... 255 or 4095; reads back", documented, every_cycle,
             "whether it reads 0 while an interlock holds the outputs off"},
    Register{reg::encoder_index, "encoder index", "",
             "0 lower wheel, 1 upper wheel, 2 lever: selects the encoder of 88", documented, every_cycle},
    Register{reg::encoder_reset, "encoder reset", "", "bits 0-2, a channel each; its counter is 0 while the bit is set",
             documented, at_activation},
    Register{reg::encoder_counter, "encoder counter", "counts", "32-bit signed, of the indexed encoder", documented,
             every_cycle, "which direction is forward: the wiring decides"},
    Register{reg::start_resistors, "start resistors", "", "bit 0 R1, bit 1 R2", documented, at_activation,
             "whether the host should switch them"},
    Register{0x94, "R1 low threshold", "", "", documented, never, "its unit"},
    Register{0x98, "R1 high threshold", "", "", documented, never, "its unit"},
    Register{0x9C, "R2 low threshold", "", "", documented, never, "its unit"},
    Register{0xA0, "R2 high threshold", "", "", documented, never, abs_only},
    Register{reg::supply_min, "least supply", "V", "92000 / raw", documented, in_turn, limit_open},
    Register{reg::temperature_max, "highest temperature", "deg C", "raw", documented, in_turn, limit_open},
    Register{reg::trip_flags, "trip flags", "", "bit 1 supply; bits 0 and 2 temperature and overspeed", documented,
             in_turn, "which of bits 0 and 2 is temperature and which overspeed: any bit counts as a trip"},
    Register{reg::temperature_high, "temperature sensor, high time", "", "235 - 400 high / low is deg C", inferred,
             in_turn},
    Register{reg::temperature_low, "temperature sensor, low time", "", "as the high time", inferred, in_turn,
             "what it shows without a sensor; the driver takes 0 as no sensor"},
};

std::unique_ptr<RigDriver> make_pci_driver(const PciOptions& options, const RunFacts& run) {
  PciOptions pci = options;
  pci.encoder_counts_per_rev = run.encoder_counts_per_rev;
  return pci_driver(
      pci, [pci, run] { return open_card(pci, run.lock_step, run.emulated); }, run.lock_step ? nullptr : monotonic_ns);
}

bool is_of_the_kernel(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::weakly_canonical(file, error).string().starts_with("/sys/") || error;
}

/// Files of the kernel belong to real cards, even behind links from another folder. Other files are an emulator's only
/// if its registers carry the mark.
BoardReality pci_reality(const PciOptions& options) {
  const BoardReality hardware{.option = "driver.pci.root = " + options.root,
                              .is = "holds the real cards; give the emulator's folder"};
  if (is_of_the_kernel(options.root)) return hardware;
  bool found = false;
  for (const FoundBoard& board : survey_cards(options)) {
    const std::optional<bool> marked = carries_mark(board.files.front());
    if (marked && !*marked) return hardware;
    found = found || marked;
  }
  return {.reality = found ? Reality::emulator : Reality::silent};
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

std::span<const Register> registers() noexcept { return table; }

double velocity_rad_s(std::uint32_t raw, std::uint32_t period_ticks) noexcept {
  if (period_ticks == 0) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * std::numbers::pi * static_cast<double>(raw & low_16_bits) *
         (board_clock_Hz / static_cast<double>(period_ticks)) / encoder_lines_per_rev;
}

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

std::vector<std::string> shown_registers(RegisterWindow& window) {
  std::uint32_t period_ticks = 0;
  static_cast<void>(window.read32(reg::velocity_period, period_ticks));  // 0 makes the velocities NaN
  std::vector<std::string> lines;
  for (const Register& entry : registers()) {
    std::uint32_t raw = 0;
    const IoResult result = window.read32(entry.offset, raw);
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
  if (window.read32(reg::temperature_high, high).ok() && window.read32(reg::temperature_low, low).ok()) {
    lines.push_back(formatted("    temperature %.1f deg C", temperature_C(high, low)));
  }
  return lines;
}

}  // namespace abs_hil::driver::pci
