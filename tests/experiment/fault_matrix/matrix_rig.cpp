// The rigs of the fault matrix, each a backend in this process.
#include "matrix_rig.hpp"

#include "driver/hm2/register_board.hpp"
#include "driver/pci/model_card.hpp"
#include "experiment/simulated_run.hpp"

namespace abs_hil::experiment::test {

namespace {

class SimulatedRig final : public MatrixRig {
 public:
  explicit SimulatedRig(const Setup& setup)
      : made_(std::make_unique<driver::SimDriver>(setup.plant, driver::SimStart{.seed = setup.seed})),
        sim_(made_.get()) {}
  std::unique_ptr<driver::RigDriver> driver() override { return std::move(made_); }
  bool at_rest() const override {
    const plant_sim::PlantInput& wire = sim_->outputs();
    return wire.motor_duty == 0.0 && wire.brake_duty == 0.0 && wire.brake_torque_Nm == 0.0;
  }

 private:
  std::unique_ptr<driver::SimDriver> made_;
  const driver::SimDriver* sim_;
};

/// The registers of the emulated card, whose time advances only with the driver's.
class EmulatedCard final : public MatrixRig {
 public:
  explicit EmulatedCard(const Setup& setup) : card_({.plant = setup.plant}) {}
  std::unique_ptr<driver::RigDriver> driver() override { return driver::pci::pci_driver({}, card_.opener()); }
  bool at_rest() const override {
    const emulator::Outputs out = card_.model.outputs();
    return out.drive_duty == 0.0 && out.brake_duty == 0.0;
  }

 private:
  abs_hil::test::ModelCard card_;
};

/// The same for a HostMot2 board.
class EmulatedHm2 final : public MatrixRig {
 public:
  explicit EmulatedHm2(const Setup& setup) : board_(0.0, setup.plant) {}
  std::unique_ptr<driver::RigDriver> driver() override {
    return std::make_unique<abs_hil::test::TimedDriver>(
        board_, std::make_unique<driver::hm2::Hm2Driver>(driver::hm2::Hm2Options{}, cable_.opener()));
  }
  bool at_rest() const override {
    const emulator::Outputs out = board_.outputs();
    return out.drive_duty == 0.0 && out.brake_duty == 0.0;
  }

 private:
  abs_hil::test::RegisterBoard board_;
  abs_hil::test::Cable cable_{board_};
};

}  // namespace

std::unique_ptr<MatrixRig> make_matrix_rig(Backend backend, const Setup& setup) {
  if (backend == Backend::card) return std::make_unique<EmulatedCard>(setup);
  if (backend == Backend::hm2) return std::make_unique<EmulatedHm2>(setup);
  return std::make_unique<SimulatedRig>(setup);
}

}  // namespace abs_hil::experiment::test
