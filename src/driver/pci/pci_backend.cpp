#include "driver/pci/pci_backend.hpp"

#include <filesystem>

#include "driver/monotonic_time.hpp"
#include "driver/pci/discovery.hpp"
#include "driver/pci/pci_driver.hpp"
#include "driver/pci/pci_safe_state.hpp"
#include "driver/pwm.hpp"

namespace abs_hil::driver::pci {

namespace {

std::unique_ptr<RigDriver> make_pci_driver(const PciOptions& options, const RunFacts& run) {
  PciOptions pci = options;
  pci.encoder_counts_per_rev = run.encoder_counts_per_rev;
  return std::make_unique<PciDriver>(
      pci, [pci, lock_step = run.lock_step] { return open_card(pci, lock_step); },
      run.lock_step ? nullptr : monotonic_ns);
}

std::unique_ptr<SafeStateWriter> make_pci_writer(const PciOptions& options, const RunFacts& run) {
  return std::make_unique<PciSafeState>(options, run.beside_guardian);
}

bool is_of_the_kernel(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::weakly_canonical(file, error).string().starts_with("/sys/") || error;
}

/// Files of the kernel belong to real cards, even where driver.emulated says otherwise, and even behind links from
/// another folder. All other files are an emulator's.
BoardReality pci_reality(const PciOptions& options) {
  bool real = is_of_the_kernel(options.root);
  for (const FoundBoard& board : survey_cards(options)) real = real || is_of_the_kernel(board.files.front());
  if (!real) return {.reality = Reality::emulator};
  return {.reality = Reality::hardware,
          .option = "driver.pci.root = " + options.root,
          .is = "holds the real cards; give the emulator's folder"};
}

}  // namespace

Backend pci_backend() {
  return backend<PciOptions>({
      .name = "pci",
      .summary = "RT-DAC4/PCI with ABS logic; unverified on hardware",
      .not_verified = "The register map comes from the maker's documents and has been tested only with an emulator. Do "
                      "the checks of docs/rig-setup.md with abs_hil commission",
      .make_driver = make_pci_driver,
      .make_safe_state_writer = make_pci_writer,
      .outputs = pwm_grid<PciOptions>,
      .reality = pci_reality,
      .find = survey_cards,
      .free_options = {"root", "bdf", "bitstream", "plausible_speed_rad_s"},
  });
}

}  // namespace abs_hil::driver::pci
