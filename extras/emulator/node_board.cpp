// The core of the node's firmware in place of a chip: it gets the time, the encoders' counts and the datagrams, and its
// duties act on the rig. In lock-step this file, not the core, answers space 5 (docs/hm2-emulator.md).

#include <algorithm>
#include <cstring>

#include "emulator/udp_board.hpp"
#include "node_core.h"

namespace abs_hil::emulator {

namespace {

// Words of LBP16 commands in space 5.
constexpr unsigned advances_time = 0xD682;  // then 8 bytes, ns
constexpr unsigned reads_time = 0x5682;
constexpr unsigned reads_mark = 0x7582;
constexpr std::size_t time_bytes = 8;

/// Calls `use` with each whole command's word, the place of its data, and the bytes of the answer before its own.
template <typename Use>
void for_each_command(std::span<const std::uint8_t> datagram, Use use) {
  std::size_t answered = 0;
  for (std::size_t at = 0; at + 2 <= datagram.size();) {
    const unsigned word = datagram[at] | static_cast<unsigned>(datagram[at + 1]) << 8U;
    const std::size_t bytes = std::size_t{word & 0x7FU} << ((word >> 8U) & 3U);
    const bool write = (word & 0x8000U) != 0;
    const std::size_t data_at = at + ((word & 0x4000U) != 0 ? 4 : 2);
    at = data_at + (write ? bytes : 0);
    if (at > datagram.size()) return;
    use(word, data_at, answered);
    if (!write) answered += bytes;
  }
}

/// The chip's loop looks at the counters and the watchdog at every step of the rig and at every datagram.
class NodeBoard final : public UdpBoard {
 public:
  explicit NodeBoard(const BoardOptions& options) : UdpBoard(options) {
    std::memcpy(identity_.name, options.name.data(), options.name.size());
    std::memcpy(identity_.idrom_name, options.name.starts_with("7I92") ? "MESA7I92" : "ABS-NODE", 8);
    std::memcpy(identity_.mac, options.mac.data(), sizeof identity_.mac);
    std::memcpy(identity_.address, options.address.data(), sizeof identity_.address);
    start();
  }

  [[nodiscard]] std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) override {
    // The core knows no space 5, and would refuse a datagram with a write to it.
    const std::vector<std::uint8_t> for_core =
        options_.lock_step ? obey_lock_step(datagram) : std::vector(datagram.begin(), datagram.end());
    look();
    const bool was_latched = core_.latched;
    std::vector<std::uint8_t> reply(NODE_MOST_BYTES);
    reply.resize(node_datagram(&core_, now_us(), for_core.data(), for_core.size(), reply.data()));
    if (!reply.empty()) answer_space_5(datagram, reply);
    bool writes = false;
    for_each_command(datagram, [&writes](unsigned word, std::size_t /*data_at*/, std::size_t /*answered*/) {
      constexpr unsigned write_and_space = 0x9C00;
      if ((word & write_and_space) == 0x8000U) writes = true;
    });
    if (writes) ++writes_;
    if (core_.latched && !was_latched) log_.add(time_ns(), "watchdog");
    note_outputs(core_.latched && !was_latched ? "watchdog" : "commanded");
    return reply;
  }
  void power_cycle() override { start(); }
  void bite() override {
    core_.armed = true;
    core_.allowed_us = 0;
    look();
  }
  void stood_still(std::int64_t duration_ns) override {
    standing_ns_ = time_ns();
    advance_to(time_ns() + duration_ns);
    standing_ns_.reset();
    paused_ns_ += duration_ns;
  }
  void turn_by_hand(bool upper_wheel, double revolutions) override {
    // In parts that the 16 bits of the hardware's counter can tell from turns backwards.
    constexpr int parts = 64;
    for (int n = 0; n < parts; ++n) {
      UdpBoard::turn_by_hand(upper_wheel, revolutions / parts);
      look();
    }
  }

  [[nodiscard]] Outputs outputs() const noexcept override {
    const auto duty = [this](std::uint32_t channel) { return node_duty(&core_, channel) / 4096.0; };
    const bool enabled = options_.enable_line < 0 || node_output(&core_);
    return {.drive_duty = emergency_stop() || !enabled ? 0.0 : duty(0), .brake_duty = duty(1)};
  }
  [[nodiscard]] bool bitten() const noexcept override { return core_.latched; }
  [[nodiscard]] bool drives_pins() const noexcept override { return node_drives(&core_, 0) || node_drives(&core_, 1); }
  [[nodiscard]] std::string registers_text() const override {
    std::string text = rig::formatted("0C00=%08x 0D00=%08x", core_.watchdog_clocks, core_.latched ? 1U : 0U);
    for (unsigned i = 0; i < NODE_CHANNELS; ++i) {
      for (unsigned k = 0; k < 5; ++k)
        text += rig::formatted(" %04X=%08x", 0x1000 + 0x100 * k + 4 * i, core_.port[k][i]);
      text += rig::formatted(" %04X=%08x %04X=%08x %04X=%08x", 0x3100 + 4 * i, core_.counter_control[i], 0x4000 + 4 * i,
                             core_.pwm_value[i], 0x4100 + 4 * i, core_.pwm_mode[i]);
    }
    return text + rig::formatted(" 3200=%08x 3400=%08x 4200=%08x 4300=%08x 4400=%08x", core_.stamp_divisor,
                                 core_.filter, core_.pwm_rate, core_.pdm_rate, core_.pwm_enable);
  }

 private:
  void start() {
    node_init(&core_, &identity_);
    look();
    for (std::uint32_t& count : core_.count) count = 0;
    note_outputs("power-on");
  }
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override {
    if (!core_.armed && core_.latched) return next_ns;
    const std::uint32_t most_us = core_.armed ? core_.allowed_us : NODE_LONGEST_US;
    const auto left_us = static_cast<std::int32_t>(core_.fed_us + most_us - now_us());
    return std::clamp<std::int64_t>((time_ns() / 1000 + left_us) * 1000, time_ns(), next_ns);
  }
  void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) override { look(); }
  /// The chip's clock.
  [[nodiscard]] std::uint32_t now_us() const noexcept {
    return static_cast<std::uint32_t>((standing_ns_.value_or(time_ns()) - paused_ns_) / 1000);
  }
  /// Advances the time as the commands of space 5 say, and returns the others.
  std::vector<std::uint8_t> obey_lock_step(std::span<const std::uint8_t> datagram) {
    constexpr std::ptrdiff_t head_bytes = 4;
    std::vector<std::uint8_t> rest(datagram.begin(), datagram.end());
    for_each_command(datagram, [&](unsigned word, std::size_t data_at, std::size_t /*answered*/) {
      if (word != advances_time) return;
      std::int64_t wanted_ns = 0;
      std::memcpy(&wanted_ns, datagram.data() + data_at, time_bytes);
      constexpr std::int64_t longest_ns = 10'000'000'000;
      advance_to(std::clamp(wanted_ns, time_ns(), time_ns() + longest_ns));
      const auto data = rest.end() - static_cast<std::ptrdiff_t>(datagram.size() - data_at);
      rest.erase(data - head_bytes, data + static_cast<std::ptrdiff_t>(time_bytes));
    });
    return rest;
  }
  /// Puts what space 5 answers in place of the core's zeros.
  void answer_space_5(std::span<const std::uint8_t> datagram, std::span<std::uint8_t> reply) const {
    const std::int64_t now_ns = time_ns();
    for_each_command(datagram, [&](unsigned word, std::size_t /*data_at*/, std::size_t answered) {
      if (word == reads_time && options_.lock_step)
        std::memcpy(reply.subspan(answered, time_bytes).data(), &now_ns, time_bytes);
      const std::array<std::uint8_t, 4> mark{0x05, 0x5A, options_.lock_step ? std::uint8_t{0x0F} : std::uint8_t{0}, 0};
      if (word == reads_mark) std::memcpy(reply.subspan(answered, mark.size()).data(), mark.data(), mark.size());
    });
  }
  /// What the chip's loop does: counters, then the watchdog.
  void look() {
    for (const bool upper : {false, true}) {
      node_count(&core_, upper ? 1 : 0, static_cast<std::uint16_t>(position(upper)), now_us());
    }
    const bool was_latched = core_.latched;
    node_poll(&core_, now_us());
    if (core_.latched && !was_latched) log_.add(time_ns(), "watchdog");
    note_outputs("watchdog");
  }
  [[nodiscard]] std::int64_t last_reload_ns() const noexcept override {
    const bool never = core_.watchdog_clocks == 0x80000000U;
    return never ? -1 : time_ns() - 1000 * static_cast<std::int64_t>(now_us() - core_.fed_us);
  }

  node_identity identity_{};
  node_core core_{};
  std::int64_t paused_ns_{0};                  ///< what the chip's clock has not seen of the board's time
  std::optional<std::int64_t> standing_ns_{};  ///< since when that clock stands
};

}  // namespace

std::unique_ptr<UdpBoard> node_board(const BoardOptions& options) { return std::make_unique<NodeBoard>(options); }

}  // namespace abs_hil::emulator
