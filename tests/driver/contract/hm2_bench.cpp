// The hm2 backend for the contract tests, on the emulated board.
#include <memory>

#include "../hm2/register_board.hpp"
#include "bench.hpp"

namespace abs_hil::test {

namespace {

class Hm2Bench final : public Bench {
 public:
  driver::RigDriver& driver() override { return *driver_; }
  void destroy_driver() override { driver_.reset(); }
  Wire wire() override {
    const emulator::Outputs out = board_.outputs();
    return {out.drive_duty, out.brake_duty};
  }
  std::uint64_t writes() override { return board_.writes; }
  bool break_brake_output() override {
    // No PWM value can be read back, but the direction of its pin can.
    board_.broken_pins = 0xFFFFFFFF;
    board_.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x04, 0x11, 0x02, 0, 0, 0});
    board_.forget_last_packet();
    return true;
  }
  bool write_as_other(double drive_duty) override {
    const auto width = static_cast<unsigned>(drive_duty * 4095.0);
    board_.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x00, 0x40, 0, 0, static_cast<std::uint8_t>(width),
                                              static_cast<std::uint8_t>(width >> 8U)});
    return true;
  }
  [[nodiscard]] int read_back_cycles() const override { return 1; }
  [[nodiscard]] bool tells_health() const override { return false; }

 private:
  RegisterBoard board_{bench_speed_rad_s};
  Cable cable_{board_};
  std::unique_ptr<driver::RigDriver> driver_ = std::make_unique<TimedDriver>(
      board_, std::make_unique<driver::hm2::Hm2Driver>(driver::hm2::Hm2Options{}, cable_.opener()));
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<Hm2Bench>(); }

}  // namespace abs_hil::test
