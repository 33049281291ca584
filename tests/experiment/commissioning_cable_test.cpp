// Commissioning's step that has the watched cable pulled.

#include "commissioning_labs.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;
using Catch::Matchers::Contains;
using experiment::CommissioningResult;

namespace {

/// The person pulls the cable after 0.3 s of driving, and plugs it in again 0.05 s later; `runs_away` counts come
/// between two reads from then on.
struct CableLab : OtherLab {
  explicit CableLab(std::int32_t counts_when_back) : runs_away(counts_when_back) {
    board.cable = "Ethernet cable";
    board.on_read = [this]() -> driver::IoResult {
      constexpr int pulled_at = 300;
      constexpr int plugged_at = 350;
      if (person.said.find("Pull the Ethernet cable now") == std::string::npos) return {};
      ++reads;
      if (reads < pulled_at) return {};
      if (reads < plugged_at) return {driver::IoError::no_answer};
      if (reads == plugged_at) return {driver::IoError::read_back_mismatch};
      if (reads <= plugged_at + 2) board.counters.lower_counts += runs_away;
      return {};
    };
  }
  std::int32_t runs_away;
  int reads{0};
};

}  // namespace

TEST_CASE("A board that watches its cable has it pulled while the drive is on: the wheels must coast") {
  CableLab lab(90);
  CHECK(lab.run() == CommissioningResult::passed);
  INFO(lab.person.said);
  CHECK(lab.person.asked.size() == 7);
  CHECK_THAT(lab.person.asked.at(3), Contains("Step 4 of 5"));
  CHECK_THAT(lab.person.said, Contains("made 100 counts in 0.1 s before the cable was pulled and 90 after"));
  CHECK(lab.board.rests == 4);  // after each activation and each pulse
}

TEST_CASE("Wheels that go faster without the cable show outputs of the wrong polarity") {
  CableLab lab(200);
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains("Wire them active-low"));
}

TEST_CASE("A cable that nobody pulls ends the commissioning, the drive off") {
  OtherLab lab;
  lab.board.cable = "Ethernet cable";
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains("the cable was not pulled"));
  CHECK(lab.board.state() == driver::DriverState::inactive);
}

TEST_CASE("Who leaves while the cable is to be pulled, or at the question about it, has not failed the rig") {
  CableLab leaving(90);
  leaving.person.leaves_at = 5;
  CHECK(leaving.run() == CommissioningResult::declined);
  CHECK_THAT(leaving.person.said, !Contains("FAILED"));
  OtherLab stopping;
  stopping.board.cable = "Ethernet cable";
  stopping.person.before_answer = [&] { stopping.stop = stopping.person.asked.size() == 4; };
  CHECK(stopping.run() == CommissioningResult::interrupted);
  CHECK_THAT(stopping.person.said, !Contains("FAILED"));
}
