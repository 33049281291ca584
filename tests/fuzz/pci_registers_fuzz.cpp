// A card whose registers hold anything: the driver neither crashes nor makes a measurement of it that no rig can give.
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>

#include "driver/board_kit.hpp"
#include "driver/pci/pci_driver.hpp"
#include "fuzz_input.hpp"

namespace {

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::fuzz;

/// Answers with what was written, except where the input says otherwise: then with its bytes, or not at all.
class FuzzedWindow final : public pci::RegisterWindow {
 public:
  explicit FuzzedWindow(Input& input) : input_(input) {}
  IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override {
    const bool indexed =
        offset == pci::reg::pwm_mode || offset == pci::reg::pwm_prescaler || offset == pci::reg::pwm_width;
    const std::uint8_t how = input_.byte();
    if (how == 0xFF) return {IoError::no_answer, offset};
    if (indexed && how < 0xF0) {
      value = written_[offset / 4];
    } else if (offset == pci::reg::encoder_counter && how < 0x80) {
      count_ += how;  // plausible travel, so that runs go on
      value = count_;
    } else {
      value = 0;
      for (int i = 0; i < 4; ++i) value = value << 8U | input_.byte();
    }
    return {};
  }
  IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override {
    expect(offset < pci::window_bytes && offset % 4 == 0);
    if (offset == pci::reg::pwm_width) expect(value <= 4095);
    written_[offset / 4] = value;
    return {};
  }

 private:
  Input& input_;
  std::array<std::uint32_t, pci::window_bytes / 4> written_{};
  std::uint32_t count_{0};
};

bool nan_or_within(double value, double least, double most) {
  return std::isnan(value) || (value >= least && value <= most);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  pci::PciOptions options;
  const auto own = pci::pci_driver(options, [&input] {
    pci::Card card{.place = "fuzzed"};
    card.window = std::make_unique<FuzzedWindow>(input);
    return card;
  });
  RigDriver& driver = *own;
  try {
    driver.configure();
    static_cast<void>(driver.notes());
    static_cast<void>(driver.inspection());
    driver.activate(0);
  } catch (const Unavailable&) {
    return 0;
  }
  rig::Measurement before{};
  constexpr std::int64_t ms = 1'000'000;
  bool first = true;
  for (std::int64_t cycle = 1; cycle < 200 && !input.empty(); ++cycle) {
    rig::Measurement m;
    if (driver.read(cycle * ms, m).ok()) {
      expect(m.time_ns == cycle * ms && !m.ideal_speeds);
      expect(nan_or_within(m.supply_V, 0.0, 100.0));
      expect(nan_or_within(m.temperature_C, -100.0, 235.0));
      const std::int64_t since_ns = m.time_ns - before.time_ns;
      // The counters before the first read are those of activation, at most their slack away from 0.
      const std::int64_t elapsed_ns = first ? 200 * ms : since_ns;
      expect(plausible_travel(before.upper_counts, m.upper_counts, elapsed_ns, options));
      expect(plausible_travel(before.lower_counts, m.lower_counts, elapsed_ns, options));
      first = false;
      before = m;
    } else {
      before = m = {};
      first = true;
    }
    if (!driver.write({.motor_duty = 0.5, .motor_enable = true}).ok()) break;
    if (first) break;
  }
  return 0;
}
