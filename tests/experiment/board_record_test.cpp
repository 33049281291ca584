// The record of a commissioned board: a run needs one, and it holds for this board alone.
#include "experiment/board_record.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "abs_hil/driver/io_result.hpp"
#include "catch.hpp"
#include "driver/board_options.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using Catch::Matchers::Contains;

namespace {

const driver::BoardIdentity card{.place = "0000:03:00.0", .logic = "bitstream 2741"};

struct Lab {
  test::TemporaryFolder folder{};
  driver::DriverOptions options{.kind = "pci", .records = folder.path.string()};
  RigIdentity rig{};
  driver::pci::PciOptions& pci{options.boards.of<driver::pci::PciOptions>()};

  void commission(bool emulated = false) const {
    write_record(describe_board(options, rig, card, emulated), record_folders(options.records));
  }
  [[nodiscard]] std::string refusal(const driver::BoardIdentity& board = card) const {
    try {
      require_record(options, rig, board);
    } catch (const driver::Unavailable& error) {
      return error.what();
    }
    return {};
  }
};

}  // namespace

TEST_CASE("A board without a record is refused with the command to type") {
  Lab lab;
  lab.pci.bdf = "0000:03:00.0";
  CHECK_THAT(lab.refusal(), Contains("pci 0000:03:00.0, bitstream 2741") &&
                                Contains("no record in " + lab.options.records) &&
                                Contains("Type: abs_hil commission --set driver.records=") &&
                                Contains(" --set driver.pci.bdf=0000:03:00.0"));
  lab.commission();
  CHECK(lab.refusal().empty());
}

TEST_CASE("A record holds for its own board and logic alone") {
  const Lab lab;
  lab.commission();
  CHECK(lab.refusal().empty());
  CHECK_THAT(lab.refusal({.place = "0000:04:00.0", .logic = card.logic}), Contains("no record in"));
  CHECK_THAT(lab.refusal({.place = card.place, .logic = "bitstream 0"}),
             Contains("had bitstream 2741 then and has bitstream 0 now"));
}

TEST_CASE("A record holds for the signs, channels and PWMs that were tried, and for lower caps") {
  Lab lab;
  lab.pci.brake_duty_max = 0.6;
  lab.commission();
  SECTION("sign") {
    lab.pci.upper_sign = -1;
    CHECK_THAT(lab.refusal(), Contains("driver.pci.upper_sign was 1 then and is -1 now"));
  }
  SECTION("channel") {
    lab.pci.lower_channel = 2;
    CHECK_THAT(lab.refusal(), Contains("driver.pci.lower_channel was 0 then and is 2 now"));
  }
  SECTION("mode") {
    lab.pci.pwm_mode = "8-bit";
    CHECK_THAT(lab.refusal(), Contains("driver.pci.pwm_mode was 12-bit then"));
  }
  SECTION("higher cap") {
    lab.pci.brake_duty_max = 0.61;
    CHECK_THAT(lab.refusal(), Contains("driver.pci.brake_duty_max was 0.6 then and is 0.61 now"));
  }
  SECTION("lower cap") {
    lab.pci.brake_duty_max = 0.5;
    CHECK(lab.refusal().empty());
  }
  SECTION("counts") {
    lab.options.encoder_counts_per_rev = 1024;
    CHECK_THAT(lab.refusal(), Contains("encoder_counts_per_rev was 4096 then and is 1024 now"));
  }
  SECTION("where the card is found") {
    lab.pci.bdf = card.place;
    lab.pci.plausible_speed_rad_s = 400.0;
    CHECK(lab.refusal().empty());
  }
}

TEST_CASE("A record holds for the identity of the rig alone, from which the limits come") {
  Lab lab;
  lab.rig.parameters.tyre.theta_N = 40.0;
  lab.commission();
  CHECK(lab.refusal().empty());
  lab.rig.source = "elsewhere.toml";  // the values count
  CHECK(lab.refusal().empty());
  for (double* value : {&lab.rig.parameters.tyre.theta_N, &lab.rig.parameters.motor.stall_torque_Nm,
                        &lab.rig.parameters.brake.b1_Nm, &lab.rig.parameters.wheels.J2_kg_m2}) {
    const double kept = *value;
    *value *= 0.1;
    CHECK_THAT(lab.refusal(), Contains("the rig's identity, from which the limits come, has changed: rig."));
    *value = kept;
  }
  CHECK(lab.refusal().empty());
}

TEST_CASE("A record that is older than a key of the identity holds for the key's default alone") {
  Lab lab;
  BoardRecord record = describe_board(lab.options, lab.rig, card, false);
  CHECK(record.identity.erase("rig.brake_dead_time_s") == 1);
  write_record(record, record_folders(lab.options.records));
  CHECK(lab.refusal().empty());
  lab.rig.parameters.brake.brake_dead_time_s = 0.0129;
  CHECK_THAT(lab.refusal(), Contains("rig.brake_dead_time_s was 0 then and is 0.0129 now"));
}

TEST_CASE("A record that somebody has edited, or without a checksum, is refused") {
  const Lab lab;
  lab.commission();
  const auto file = lab.folder.path / "pci-0000_03_00.0.json";
  std::stringstream whole;
  whole << std::ifstream(file).rdbuf();
  const std::string text = whole.str();
  for (const auto& [was, is] : std::initializer_list<std::pair<std::string, std::string>>{
           {R"("rig.theta_N": "23")", R"("rig.theta_N": "500")"},
           {R"("emulated": false)", R"("emulated":  false,"more": 1)"},
           {R"("abs_hil_board_record": 2)", R"("abs_hil_board_record": 1)"},
           {R"("checksum": )", R"("checksum_of_old": )"}}) {
    INFO(is);
    std::string edited = text;
    REQUIRE(edited.find(was) != std::string::npos);
    std::ofstream(file) << edited.replace(edited.find(was), was.size(), is);
    CHECK_THAT(lab.refusal(), Contains(file.string() + " is no commissioning record"));
  }
  std::ofstream(file) << text;
  CHECK(lab.refusal().empty());
}

TEST_CASE("The first folder that has a record of the board decides") {
  const Lab lab;
  const std::filesystem::path machine = lab.folder.path / "machine";
  const std::filesystem::path user = lab.folder.path / "user";
  BoardRecord record = describe_board(lab.options, lab.rig, card, false);
  write_record(record, {user});
  CHECK(why_not_commissioned(record, {machine, user}).empty());
  RigIdentity other;
  other.parameters.tyre.theta_N = 230.0;
  write_record(describe_board(lab.options, other, card, false), {machine});
  CHECK_THAT(why_not_commissioned(record, {machine, user}),
             Contains("rig.theta_N was 230 then and is 23 now") && Contains(machine.string()));
}

TEST_CASE("The record of an emulator holds for no hardware") {
  const Lab lab;
  lab.commission(true);
  CHECK_THAT(lab.refusal(), Contains("it is the record of an emulator"));
}

TEST_CASE("A file that is no record is named, and a record lies there whole or not at all") {
  const Lab lab;
  lab.commission();
  const auto file = lab.folder.path / "pci-0000_03_00.0.json";
  REQUIRE(std::filesystem::exists(file));
  CHECK_FALSE(std::filesystem::exists(file.string() + ".new"));
  for (const char* text : {"", "{", "{}", R"({"abs_hil_board_record": 2})"}) {
    std::ofstream(file) << text;
    CHECK_THAT(lab.refusal(), Contains(file.string() + " is no commissioning record"));
  }
}

TEST_CASE("A folder that takes no record is skipped; without any, the error names a way out") {
  const Lab lab;
  std::ofstream(lab.folder.path / "file") << "not a folder";
  const BoardRecord record = describe_board(lab.options, {}, card, false);
  const auto closed = lab.folder.path / "file" / "boards";
  CHECK(write_record(record, {closed, lab.folder.path / "open"}).parent_path() == lab.folder.path / "open");
  CHECK_THROWS_WITH(write_record(record, {closed}), Contains("cannot be written") && Contains("driver.records=DIR"));
}

TEST_CASE("Without a configured folder, records are the system's or the user's") {
  ::setenv("XDG_STATE_HOME", "/home/somebody/state", 1);
  CHECK(record_folders("") ==
        std::vector<std::filesystem::path>{"/var/lib/abs_hil/boards", "/home/somebody/state/abs_hil/boards"});
  ::unsetenv("XDG_STATE_HOME");
  ::setenv("HOME", "/home/somebody", 1);
  CHECK(record_folders("").back() == "/home/somebody/.local/state/abs_hil/boards");
  CHECK(record_folders("/x") == std::vector<std::filesystem::path>{"/x"});
}
