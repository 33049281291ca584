// What `abs_hil doctor` says of boards and of what keeps them from use.
#include "catch.hpp"
#include "diagnosis/doctor.hpp"

using namespace abs_hil;
using namespace abs_hil::diagnosis;

TEST_CASE("A board that nothing keeps from use is good") {
  const Finding finding = judge("pci", {{.what = "RT-DAC4/PCI at 0000:03:00.0", .detail = "enabled"}}).front();
  CHECK(finding.standing == Standing::good);
  CHECK(finding.what == "RT-DAC4/PCI at 0000:03:00.0");
  CHECK(finding.detail == "enabled");
}

TEST_CASE("Each obstacle is a warning with its fix") {
  const driver::FoundBoard board{.what = "a board",
                                 .obstacles = {{"not enabled", "enable it"}, {"owned", "unbind it"}}};
  const Finding finding = judge("pci", {board}).front();
  CHECK(finding.standing == Standing::warning);
  CHECK(finding.detail == "not enabled; owned");
  CHECK(finding.fix == "enable it\nunbind it");
}

TEST_CASE("No board is a note: the simulated rig needs none") {
  CHECK(worst(judge("usb", {})) == Standing::note);
  CHECK(judge("usb", {}).front().what == "no board of driver.kind=usb found");
}
