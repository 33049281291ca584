// The PCI backend for the contract tests, on the emulated card.
#include <algorithm>

#include "../pci/model_card.hpp"
#include "bench.hpp"

namespace abs_hil::test {

namespace {

class PciModelBench final : public Bench {
 public:
  driver::RigDriver& driver() override { return *driver_; }
  void destroy_driver() override { driver_.reset(); }
  Wire wire() override {
    const emulator::Outputs out = card_.model.outputs();
    return {out.drive_duty, out.brake_duty};
  }
  std::uint64_t writes() override {
    return static_cast<std::uint64_t>(
        std::count_if(card_.traffic.begin(), card_.traffic.end(), [](const auto& access) { return access.is_write; }));
  }
  bool break_brake_output() override {
    card_.faulty.set("6c:wrong=1");
    // The drive's width is off by one too: its read-back fails first, and both outputs are still made safe.
    return true;
  }
  bool write_as_other(double drive_duty) override {
    card_.model.write32(0x60, 0);
    card_.model.write32(0x6C, static_cast<std::uint32_t>(drive_duty * 4095.0));
    return true;
  }

 private:
  ModelCard card_{{.start_speed_rad_s = bench_speed_rad_s}};
  std::unique_ptr<driver::RigDriver> driver_ = driver::pci::pci_driver({}, card_.opener());
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<PciModelBench>(); }

}  // namespace abs_hil::test
