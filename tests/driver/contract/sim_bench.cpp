// The simulated rig for the contract tests.
#include "bench.hpp"
#include "driver/sim/sim_driver.hpp"

namespace abs_hil::test {

namespace {

class SimBench final : public Bench {
 public:
  driver::RigDriver& driver() override { return *driver_; }
  void destroy_driver() override {
    // What acts on the rig is the driver's own and goes with it.
    outputs_after_ = driver_->deactivate().ok() ? Wire{} : wire();
    driver_.reset();
  }
  Wire wire() override {
    if (!driver_) return outputs_after_;
    return {driver_->outputs().motor_duty, driver_->outputs().brake_duty};
  }
  std::uint64_t writes() override { return 0; }
  [[nodiscard]] bool has_registers() const override { return false; }
  bool break_brake_output() override { return false; }
  bool write_as_other(double /*drive_duty*/) override { return false; }

 private:
  std::unique_ptr<driver::SimDriver> driver_ = std::make_unique<driver::SimDriver>(
      plant_sim::PlantOptions{}, driver::SimStart{.start_speed_rad_s = bench_speed_rad_s});
  Wire outputs_after_{};
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<SimBench>(); }

}  // namespace abs_hil::test
