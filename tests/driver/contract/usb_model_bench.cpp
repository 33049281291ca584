// The USB backend for the contract tests, on the emulated board.
#include "../usb/model_board.hpp"
#include "bench.hpp"

namespace abs_hil::test {

namespace {

class UsbModelBench final : public Bench {
 public:
  driver::RigDriver& driver() override { return *driver_; }
  void destroy_driver() override { driver_.reset(); }
  Wire wire() override {
    const emulator::Outputs out = board_.model.outputs();
    return {out.drive_duty, out.brake_duty};
  }
  std::uint64_t writes() override { return board_.model.frames_taken(); }
  bool break_brake_output() override {
    board_.model.break_brake(true);
    return true;
  }
  bool write_as_other(double drive_duty) override {
    const auto image = board_.model.image();
    driver::usb::Frame frame = driver::usb::frame_from(std::span(image).first<driver::usb::frame_bytes>());
    driver::usb::put_outputs(frame, {}, static_cast<std::uint32_t>(drive_duty * 4095.0), 0, false);
    return board_.model.take(frame) == emulator::UsbBoardModel::Taken::frame;
  }
  [[nodiscard]] int read_back_cycles() const override { return 1; }
  [[nodiscard]] bool tells_health() const override { return false; }

 private:
  ModelBoard board_{{.start_speed_rad_s = bench_speed_rad_s}};
  std::unique_ptr<driver::RigDriver> driver_ = driver::usb::usb_driver({}, board_.opener());
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<UsbModelBench>(); }

}  // namespace abs_hil::test
