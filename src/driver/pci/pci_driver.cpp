// The driver of the RT-DAC4/PCI: activation, one cycle of register accesses, safe state.
#include "driver/pci/pci_driver.hpp"

#include <optional>
#include <utility>

#include "rig/formatted_text.hpp"

namespace abs_hil::driver::pci {

using rig::formatted;

namespace {

/// If reading both counters takes longer, they belong to different instants (28 counts at 170 rad/s) and are read
/// again.
constexpr std::int64_t late_reading_ns = 250'000;
constexpr std::uint32_t encoder_wheels = 2;

constexpr const char* refusal_hint =
    ". The kernel is probably locked down (Secure Boot): switch Secure Boot off, or boot without lockdown=";

/// A sequence of accesses to the card. After the first error all later accesses are skipped.
class Access {
 public:
  explicit Access(RegisterWindow& window) noexcept : window_(window) {}

  /// The value read; 0 after an error.
  std::uint32_t read(std::uint32_t offset) noexcept {
    std::uint32_t value = 0;
    if (result_.ok()) result_ = window_.read32(offset, value);
    if (result_.ok() && value == all_ones) all_ones_at_ = offset;
    return value;
  }
  void write(std::uint32_t offset, std::uint32_t value) noexcept {
    if (result_.ok()) result_ = window_.write32(offset, value);
  }
  void fail(IoError error, std::uint32_t where) noexcept {
    if (result_.ok()) result_ = {error, where};
  }

  [[nodiscard]] const IoResult& result() const noexcept { return result_; }
  /// Of the last register that read as all ones; nothing if none did.
  [[nodiscard]] std::optional<std::uint32_t> all_ones_at() const noexcept { return all_ones_at_; }

 private:
  RegisterWindow& window_;
  IoResult result_{};
  std::optional<std::uint32_t> all_ones_at_{};
};

class PciDriver final : public BoardDriver {
 public:
  PciDriver(const PciOptions& options, OpenCard open_card, ReadClock read_clock)
      : BoardDriver(pwm_grid(options), read_clock),
        options_(options),
        mode_(pwm_mode_named(options.pwm_mode)),
        open_card_(std::move(open_card)) {
    check_options("driver.pci.", options);
  }
  ~PciDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  [[nodiscard]] std::vector<std::string> notes() const override {
    if (!card_.window) return {};
    const auto prescaler = static_cast<std::uint32_t>(options_.pwm_prescaler);
    std::vector<std::string> notes;
    notes.push_back("card " + card_.place + ": BAR 2, I/O ports, opened and locked");
    notes.push_back(formatted(
        "bitstream version 0x%04x (%s), channel counts 0x%04x: %u counters, %u timers", version_ & low_16_bits,
        options_.bitstream >= 0 ? "as configured" : "not compared: driver.pci.bitstream is not set",
        channel_counts_ & low_16_bits, (channel_counts_ >> 12U) & 0xFU, (channel_counts_ >> 8U) & 0xFU));
    notes.push_back(formatted("PWM %s, prescaler %u: %.4g Hz; drive duty at most %.3g, brake duty at most %.3g",
                              options_.pwm_mode.c_str(), prescaler, pwm_frequency_Hz(mode_, prescaler),
                              options_.motor_duty_max, options_.brake_duty_max));
    notes.push_back(formatted("%zu register accesses a cycle (%zu reading, %zu writing), about 1 us each on PCI",
                              accesses_per_cycle, accesses_in_read, accesses_in_write));
    return notes;
  }
  [[nodiscard]] std::vector<std::string> inspection() override {
    return card_.window ? shown_registers(*card_.window) : std::vector<std::string>{};
  }
  [[nodiscard]] BoardIdentity identity() const override {
    if (!card_.window) return {};
    return {.place = card_.address, .logic = "bitstream " + std::to_string(version_ & 0xFFFFU)};
  }
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override {
    if (!card_.window) return false;
    Access card(*card_.window);
    const auto width = [&](Pwm pwm) {
      card.write(reg::pwm_index, static_cast<std::uint32_t>(pwm));
      return pwm_bits(reg::pwm_width, card.read(reg::pwm_width));
    };
    const std::uint32_t motor = width(Pwm::drive);
    applied = command_shown(motor, width(Pwm::brake), grid_.duty_steps);
    return card.result().ok();
  }
  [[nodiscard]] IoResult try_write() noexcept override {
    if (!card_.window) return {IoError::disconnected};
    // With its own value the index selects what it selected before.
    std::uint32_t index = 0;
    if (const IoResult result = card_.window->read32(reg::pwm_index, index); !result.ok()) return result;
    return card_.window->write32(reg::pwm_index, pwm_bits(reg::pwm_index, index));
  }

 private:
  void do_configure() override {
    card_ = {};  // releases the lock if this driver holds it
    card_ = open_card_();
    Access card(*card_.window);
    version_ = card.read(reg::bitstream_version);
    channel_counts_ = card.read(reg::channel_counts);
    const std::uint32_t supply = card.read(reg::supply);
    const auto refuse = [this](const std::string& what) {
      const std::string text = "backend rig: card " + card_.place + ": " + what + "; nothing was written";
      card_ = {};
      throw Unavailable(text);
    };
    if (const IoResult& result = card.result(); !result.ok()) refuse(error_text(result));
    if (version_ == all_ones) {
      refuse("answers all ones: it is not on the bus; check its power, its slot and that its I/O decoding is enabled");
    }
    if (options_.bitstream >= 0 && (version_ & low_16_bits) != static_cast<std::uint32_t>(options_.bitstream)) {
      refuse("bitstream version " + std::to_string(version_ & low_16_bits) + " is not the configured " +
             std::to_string(options_.bitstream) +
             " (driver.pci.bitstream): another logic has other registers. Load the ABS logic or correct the key");
    }
    if (const std::uint32_t counters = counters_of(channel_counts_); counters < encoder_wheels) {
      refuse("register 04 gives it " + std::to_string(counters) +
             " encoder counters, and the rig needs 2: it has another logic, or it is another card");
    }
    if (supply == 0) refuse("supply 0 V: the rig is switched off; press its ON button, release the E-stop");
  }
  void do_activate(std::int64_t now_ns) override {
    Access card(*card_.window);
    health_ = {};
    next_health_ = next_setting_ = 0;
    widths_sent_ = {};
    counts_ = {};
    last_read_ns_ = now_ns;
    IoResult result{};
    if (card_.time) result = card_.time->start(now_ns);
    if (result.ok()) {
      take_over(card);
      result = checked_for_absence(card);
    }
    // Bound on the time between reset and reading.
    constexpr std::int64_t reset_takes_at_most_ns = 100'000'000;
    if (result.ok() && !plausible(now_ns + reset_takes_at_most_ns, {0, 0})) {
      result = {IoError::implausible_answer, reg::encoder_reset};
    }
    if (!result.ok()) {
      static_cast<void>(do_make_safe());
      throw Unavailable("backend rig: card " + card_.place + ": taking over the outputs failed: " + error_text(result) +
                        (result.error == IoError::access_refused ? refusal_hint : ""));
    }
  }
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    if (card_.time) {
      const IoResult result = card_.time->follow(now_ns);
      if (!result.ok()) return result;
    }
    const std::array<std::int32_t, 2> before = counts_;
    Access card(*card_.window);
    std::int64_t read_ns = now_ns;
    if (!read_wheels_at(card, read_ns)) static_cast<void>(read_wheels_at(card, read_ns));
    read_health(card, next_health_);
    if (const IoResult result = checked_for_absence(card); !result.ok()) return result;
    if (!plausible(read_ns, before)) return {IoError::implausible_answer, reg::encoder_counter};
    next_health_ = (next_health_ + 1) % health_registers.size();
    last_read_ns_ = read_ns;

    measurement = {};
    measurement.time_ns = read_ns;
    measurement.upper_counts = counts_[0];
    measurement.lower_counts = counts_[1];
    measurement.trip_flags = health_[0];
    measurement.supply_V = supply_V(health_[1]);
    measurement.temperature_C = temperature_C(health_[2], health_[3]);
    return {};
  }
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    if (!in_range(command)) return {IoError::command_out_of_range};
    Access card(*card_.window);
    sent = command;
    sent.motor_duty = rig::duty_of(update_pwm(card, Pwm::drive, grid_.motor_width(command)), grid_.duty_steps);
    sent.brake_duty = rig::duty_of(update_pwm(card, Pwm::brake, grid_.brake_width(command)), grid_.duty_steps);
    next_setting_ = (next_setting_ + 1) % settings.size();
    IoResult result = checked_for_absence(card);
    if (result.error == IoError::read_back_mismatch) return cause_of_wrong_width();
    if (result.error == IoError::foreign_writer) result.reason = rig::Reason::board_reconfigured;
    return result;
  }
  IoResult do_make_safe() noexcept override {
    if (!card_.window) return {IoError::disconnected};
    // Writes both outputs, the motor first, even if one fails. Reports the first error.
    IoResult first{};
    for (const Pwm pwm : {Pwm::drive, Pwm::brake}) {
      Access card(*card_.window);
      set_pwm(card, pwm, 0);
      if (const IoResult result = checked_for_absence(card); first.ok()) first = result;
    }
    return first;
  }

  void take_over(Access& card) noexcept {
    for (const Pwm pwm : {Pwm::drive, Pwm::brake}) {
      set_pwm(card, pwm, 0);  // before mode and prescaler, which could turn an old width into a pulse
      for (const auto& [offset, value] :
           {std::pair(reg::pwm_mode, static_cast<std::uint32_t>(mode_)),
            std::pair(reg::pwm_prescaler, static_cast<std::uint32_t>(options_.pwm_prescaler))}) {
        card.write(offset, value);
        if (pwm_bits(offset, card.read(offset)) != value) card.fail(IoError::read_back_mismatch, offset);
      }
    }
    if (options_.start_resistors >= 0) {
      card.write(reg::start_resistors, static_cast<std::uint32_t>(options_.start_resistors));
    }
    // The mask holds the counters at 0 as long as its bits are set.
    card.write(reg::encoder_reset, (1U << static_cast<std::uint32_t>(options_.upper_channel)) |
                                       (1U << static_cast<std::uint32_t>(options_.lower_channel)));
    card.write(reg::encoder_reset, 0);
    read_wheels(card);
    for (std::size_t which = 0; which < health_registers.size(); ++which) read_health(card, which);
    note_settings(card);
  }
  void read_wheels(Access& card) noexcept {
    card.write(reg::encoder_index, static_cast<std::uint32_t>(options_.upper_channel));
    const std::uint32_t upper = card.read(reg::encoder_counter);
    card.write(reg::encoder_index, static_cast<std::uint32_t>(options_.lower_channel));
    const std::uint32_t lower = card.read(reg::encoder_counter);
    if (card.result().ok()) counts_ = {with_sign(upper, options_.upper_sign), with_sign(lower, options_.lower_sign)};
  }
  /// Reads both counters and sets their time stamp; false if that took too long.
  bool read_wheels_at(Access& card, std::int64_t& read_ns) noexcept {
    if (read_clock_ == nullptr) {
      read_wheels(card);
      return true;
    }
    const std::int64_t before_ns = read_clock_();
    read_wheels(card);
    const std::int64_t took_ns = read_clock_() - before_ns;
    read_ns = before_ns + took_ns / 2;
    return took_ns < late_reading_ns || !card.result().ok();
  }
  void read_health(Access& card, std::size_t which) noexcept {
    const std::uint32_t value = card.read(health_registers[which]);
    if (card.result().ok()) health_[which] = value;
  }
  /// Writes a width and reads it back.
  void set_pwm(Access& card, Pwm pwm, std::uint32_t width) noexcept {
    card.write(reg::pwm_index, static_cast<std::uint32_t>(pwm));
    card.write(reg::pwm_width, width);
    const std::uint32_t width_read = pwm_bits(reg::pwm_width, card.read(reg::pwm_width));
    if (card.result().ok() && width_read != width && !tripped_to_zero(card, width_read)) {
      card.fail(IoError::read_back_mismatch, reg::pwm_width);
    }
  }
  /// Looks whether the PWM still has the width sent last, and writes the next one. Returns the width that the output
  /// has then: `width`, or 0 while the card's interlock holds the output off.
  std::uint32_t update_pwm(Access& card, Pwm pwm, std::uint32_t width) noexcept {
    card.write(reg::pwm_index, static_cast<std::uint32_t>(pwm));
    const std::uint32_t shown = pwm_bits(reg::pwm_width, card.read(reg::pwm_width));
    std::uint32_t& sent = widths_sent_[static_cast<std::size_t>(pwm)];
    const bool kept = shown == sent;
    if (!kept && !tripped_to_zero(card, shown)) card.fail(IoError::read_back_mismatch, reg::pwm_width);
    card.write(reg::pwm_width, width);
    sent = width;
    if (settings[next_setting_].pwm == pwm) check_setting(card);
    return kept ? width : 0;
  }
  void note_settings(Access& card) noexcept {
    for (std::size_t i = 0; i < settings.size(); ++i) {
      card.write(reg::pwm_index, static_cast<std::uint32_t>(settings[i].pwm));
      settings_[i] = card.read(settings[i].offset) & low_16_bits;
    }
  }
  void check_setting(Access& card) noexcept {
    const std::size_t turn = next_setting_;
    const auto differs = [&] { return (card.read(settings[turn].offset) & low_16_bits) != settings_[turn]; };
    // Read twice: a run need not end for one access that went wrong.
    if (differs() && differs()) card.fail(IoError::foreign_writer, settings[turn].offset);
  }
  /// Why a width is not the one sent: the register fails, the logic was loaded again, or something else has written it.
  [[nodiscard]] IoResult cause_of_wrong_width() noexcept {
    static_cast<void>(do_make_safe());
    constexpr std::uint32_t most_tries = 8;  // the other writer may come between these accesses as well
    bool takes_values = false;
    for (std::uint32_t width = 1; width <= most_tries && !takes_values; ++width) {  // of 4095: nothing moves
      Access card(*card_.window);
      set_pwm(card, Pwm::brake, width);
      takes_values = card.result().ok();
    }
    if (!takes_values) return {IoError::read_back_mismatch, reg::pwm_width};
    Access card(*card_.window);
    const std::array<std::uint32_t, settings.size()> noted = settings_;
    note_settings(card);
    const bool same = settings_ == noted || !card.result().ok();
    return {IoError::foreign_writer, reg::pwm_width, 0,
            same ? rig::Reason::foreign_writer : rig::Reason::board_reconfigured};
  }
  [[nodiscard]] bool tripped_to_zero(Access& card, std::uint32_t width_read) noexcept {
    if (width_read != 0) return false;
    // It is not known whether the width reads 0 while the FPGA holds the outputs off. If it does, the next measurement
    // must report the trip, and this is no register error.
    static_assert(health_registers[0] == reg::trip_flags);
    read_health(card, 0);
    return card.result().ok() && health_[0] != 0;
  }
  [[nodiscard]] bool plausible(std::int64_t read_ns, const std::array<std::int32_t, 2>& before) const noexcept {
    for (std::size_t wheel = 0; wheel < counts_.size(); ++wheel) {
      if (!plausible_travel(before[wheel], counts_[wheel], read_ns - last_read_ns_, options_)) return false;
    }
    return true;
  }
  [[nodiscard]] IoResult checked_for_absence(const Access& card) noexcept {
    if (!card.all_ones_at()) return card.result();
    // All ones may be a count of -1. A missing card returns all ones from every register.
    std::uint32_t version = 0;
    const IoResult result = card_.window->read32(reg::bitstream_version, version);
    if (!result.ok()) return result;
    if (version == all_ones) return {IoError::disconnected, *card.all_ones_at()};
    return card.result();
  }

  PciOptions options_;
  PwmMode mode_;
  OpenCard open_card_;
  Card card_{};
  std::uint32_t version_{0};
  std::uint32_t channel_counts_{0};

  std::int64_t last_read_ns_{0};
  std::array<std::int32_t, 2> counts_{};  ///< upper, lower; with their signs
  std::array<std::uint32_t, health_registers.size()> health_{};
  std::size_t next_health_{0};
  std::array<std::uint32_t, 2> widths_sent_{};             ///< drive, brake
  std::array<std::uint32_t, settings.size()> settings_{};  ///< at activation
  std::size_t next_setting_{0};
};

}  // namespace

std::unique_ptr<RigDriver> pci_driver(const PciOptions& options, OpenCard open_card,
                                      BoardDriver::ReadClock read_clock) {
  return std::make_unique<PciDriver>(options, std::move(open_card), read_clock);
}

}  // namespace abs_hil::driver::pci
