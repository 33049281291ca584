// The CAN backend for the contract tests, on the emulated node.
#include <memory>

#include "../can/node_on_socket.hpp"
#include "bench.hpp"

namespace abs_hil::test {

namespace {

#ifdef ABS_HIL_CONTRACT_CAN_FD
constexpr bool with_fd = true;
#else
constexpr bool with_fd = false;
#endif

class CanBench final : public Bench {
 public:
  driver::RigDriver& driver() override { return *driver_; }
  void destroy_driver() override { driver_.reset(); }
  Wire wire() override {
    const emulator::Outputs out = node_.wire();
    return {out.drive_duty, out.brake_duty};
  }
  std::uint64_t writes() override {
    return node_.with_node([](emulator::CanNode& node, emulator::NodeFaults&) { return node.writes(); });
  }
  bool break_brake_output() override {
    node_.with_node([](emulator::CanNode& node, emulator::NodeFaults&) { node.break_brake_output(0.01); });
    return true;
  }
  bool write_as_other(double drive_duty) override {
    node_.send_as_other(driver::can::frame_of(
        driver::can::id::command, {.drive_duty = static_cast<std::int64_t>(drive_duty * 10'000.0), .drive_enable = 1}));
    return true;
  }
  // OUTPUTS comes with every tenth answer; within an FD frame with each.
  [[nodiscard]] int read_back_cycles() const override { return with_fd ? 1 : 10; }

 private:
  NodeOnSocket node_{{.start_speed_rad_s = bench_speed_rad_s}};
  // The contract lets time pass without commands, which the node's watchdog would not.
  std::unique_ptr<driver::can::CanDriver> driver_ = std::make_unique<driver::can::CanDriver>(
      driver::can::CanOptions{.watchdog_ms = 10'000}, node_.opener(with_fd), true);
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<CanBench>(); }

}  // namespace abs_hil::test
