// The node's outputs without its chip: generators, pins, watchdog and latch.

#include "node_by_hand.hpp"

using namespace node_test;

TEST_CASE("After power-on the node is latched, drives nothing, and no DDR can be set") {
  Node node;
  CHECK(node.read(0x0D00) == 1);
  CHECK(node.read(0x0C00) == 0x80000000);
  node.write(0x1200, 2);
  node.write(0x0C00, 499'999);
  node.write(0x4000, 0x0FFF0000);
  node.write(0x1100, 2);
  node.write(0x1300, 2);
  CHECK(node.read(0x1100) == 0);
  CHECK(node.core.port[3][0] == 0);
  CHECK_FALSE(node.drives(0));
  CHECK(node.duty(0) == 0);
  CHECK(node.errors() == 4);
  CHECK(node.read16("01590600") == 2);  // both writes
  node.write(0x1100, 0);                // 0 may always be written
  CHECK(node.read16("01590600") == 2);
}

TEST_CASE("Activated, each generator's duty is its value; inverted or not, direction backwards or another mode: 0") {
  Node node;
  node.activate();
  CHECK(node.drives(0));
  CHECK(node.drives(1));
  node.set_duty(0, 1024);
  node.set_duty(1, 4095);
  CHECK(node.duty(0) == 1024);
  CHECK(node.duty(1) == 4095);
  CHECK((node.read(0x1000) & 2U) == 0);
  node.write(0x1400, 2);
  CHECK(node.duty(0) == 1024);
  node.write(0x4000, 0x80000000U | 1024U << 16);
  CHECK(node.duty(0) == 0);
  CHECK(node.read(0x1000) == 0x1FFFF);
  node.set_duty(0, 1024);
  CHECK(node.read(0x1000) == 0x1FFFD);
  for (const std::uint32_t outputs : {1U, 2U, 3U}) {  // swapped, up and down, PDM
    node.write(0x4100, 3 | outputs << 3U);
    CHECK(node.duty(0) == 0);
  }
  node.write(0x4100, 0x63);  // double buffered and with dither: as without
  node.write(0x4000, 0x70000000U | 1024U << 16 | 0xFFFF);
  CHECK(node.duty(0) == 1024);
  node.set_duty(0, 1);
  CHECK(node.duty(0) == 1);
  CHECK(node.read(0x1000) == 0x1FFFD);
  node.write(0x4100, 0);  // 9 bits
  node.set_duty(0, 511);
  CHECK(node.duty(0) == 511U * 8U);
  node.write(0x4100, 3);
  // Only a pin with DDR and alternate source is driven.
  node.write(0x1100, 1);
  CHECK_FALSE(node.drives(0));
  node.write(0x1100, 2);
  node.write(0x1200, 1);
  CHECK_FALSE(node.drives(0));
  CHECK(node.duty(0) == 0);
  CHECK(node.duty(1) == 4095);
  CHECK(node.read(0x4004) == 0);
  CHECK(node.read(0x1104) == 2);
  CHECK(node.read(0x1108) == 0);
}

TEST_CASE("The plain output acts while its level would be low, and only while the node is permitted to drive") {
  Node node;
  node.activate();
  node.write(0x1100, 3);
  CHECK(node_output(&node.core));
  node.write(0x1000, 1);
  CHECK_FALSE(node_output(&node.core));
  node.write(0x1400, 1);
  CHECK(node_output(&node.core));
  node.write(0x1100, 2);
  CHECK_FALSE(node_output(&node.core));
  node.write(0x1100, 3);
  node.poll(5000);
  CHECK_FALSE(node_output(&node.core));
}

TEST_CASE("PWM frequency: the divider of 125 MHz for 200 MHz rate / 2^28, within the chip's range") {
  Node node;
  CHECK(node_pwm_divider(&node.core) == 4095);
  node.write(0x4200, 0xD6);
  const double frequency = 125e6 / (node_pwm_divider(&node.core) / 16.0) / 4096.0;
  CHECK(frequency == Approx(200e6 * 214 / 268435456.0).epsilon(1e-3));
  for (const auto& [rate, divider] :
       {std::pair{1U, 4095U}, {160U, 4095U}, {161U, 4070U}, {320U, 2048U}, {30'000U, 21U}}) {
    node.write(0x4200, rate);
    CHECK(node_pwm_divider(&node.core) == divider);
  }
  node.write(0x4200, 0xFFFF);
  CHECK(node_pwm_divider(&node.core) == 16);
  node.write(0x4300, 6);
  node.write(0x4400, 3);
  node.write(0x3400, 2);
  CHECK(node.core.pdm_rate == 6);
  CHECK(node.core.pwm_enable == 3);
  CHECK(node.core.filter == 2);
}

TEST_CASE("Silence for the armed time: outputs 0, pins inputs, values 0, latched; not a us earlier") {
  for (const std::uint32_t start : {0U, 0xFFFFFFF0U}) {  // also across the clock's wrap
    Node node;
    node.poll(start);
    node.activate();
    node.set_duty(1, 2000);
    node.poll(start + 3000);
    node.feed();
    node.poll(start + 7999);
    CHECK(node.duty(1) == 2000);
    CHECK(node.read(0x0D00) == 0);
    node.poll(start + 8000);
    CHECK(node.duty(1) == 0);
    CHECK_FALSE(node.drives(1));
    CHECK(node.read(0x0D00) == 1);
    CHECK(node.read(0x1100) == 0);
    CHECK(node.read(0x1104) == 0);
    CHECK(node.core.pwm_value[1] == 0);
  }
}

TEST_CASE("The armed time is (value + 1) / 100 MHz, at most 20 ms, and a loop that is late bites before it answers") {
  Node node;
  node.activate(1'000'099);
  node.set_duty(0, 1);
  node.poll(9'999);
  CHECK(node.duty(0) == 1);
  node.feed();
  node.poll(20'000);
  CHECK(node.read(0x0D00) == 1);
  node.activate(0x7FFFFFFF);
  node.set_duty(0, 1);
  node.poll(39'999);
  CHECK(node.duty(0) == 1);
  node.now_us = 40'000;
  CHECK(node.ask("81C2000E0000005A 8142000D") == hex("01000000"));
  CHECK(node.duty(0) == 0);
  CHECK(node.core.allowed_us == 20'000);
}

TEST_CASE("The latch holds: DDR and status do not bring outputs back while a value is not 0") {
  Node node;
  node.activate();
  node.set_duty(0, 1000);
  node.poll(6'000);
  CHECK(node.read(0x0D00) == 1);
  node.set_duty(0, 1000);
  node.write(0x1100, 2);
  CHECK(node.duty(0) == 0);
  CHECK(node.read16("01590600") == 1);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 1);
  CHECK(node.errors() == 4);
  CHECK(node.read16("01590600") == 2);
  node.write(0x0D00, 1);
  CHECK(node.read(0x0D00) == 1);
  node.set_duty(0, 0);
  node.set_duty(1, 1);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 1);
  node.set_duty(1, 0);
  for (const std::uint32_t other : {1U, 2U, 0x100U, 0x80000000U}) node.write(0x0D00, other);  // only 0 opens it
  CHECK(node.read(0x0D00) == 1);
  CHECK(node.read16("01590600") == 3);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x1100, 2);
  node.set_duty(0, 1000);
  CHECK_FALSE(node.drives(0));  // the bite has disarmed it
  node.poll(25'000);            // within 20 ms of its opening
  CHECK(node.read(0x0D00) == 0);
  node.write(0x0C00, 499'999);
  CHECK(node.duty(0) == 1000);
  // Without a latch the status may be written at any value.
  node.write(0x0D00, 0);
  CHECK(node.duty(0) == 1000);
  CHECK(node.read16("01590600") == 3);
}

TEST_CASE("A host that feeds after a bite has not noticed it: its status does not open the latch until it disarms") {
  for (const std::uint32_t disarms : {0x80000000U, 0xFFFFFFFFU, 0U, 1U, 98U}) {
    Node node;
    node.activate();
    node.poll(6'000);
    node.feed();  // goes on, with the duty 0 that it commands just now
    node.set_duty(0, 0);
    node.set_duty(1, 0);
    for (const std::uint32_t clocks : {499'999U, 99U, 0x7FFFFFFFU}) {  // LinuxCNC's soft reset: time, status, DDR
      node.write(0x0C00, clocks);
      node.write(0x0D00, 0);
      node.write(0x1100, 2);
      CHECK(node.read(0x0D00) == 1);
      CHECK(node.read(0x1100) == 0);
    }
    node.write(0x0C00, 0x80000000);  // armed: a bite
    node.feed();
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 1);
    node.write(0x0C00, 1);
    node.feed();  // of a time that bites at once
    node.write(0x0C00, 499'999);
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 1);
    node.write(0x0C00, disarms);
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 0);
    CHECK_FALSE(node.drives(0));
    node.write(0x0C00, 499'999);
    node.write(0x1100, 2);
    node.set_duty(0, 1000);
    CHECK(node.duty(0) == 1000);
    node.feed();  // in time: no sign of anything
    node.set_duty(0, 0);
    node.poll(20'000);
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 0);
  }
}

TEST_CASE("After power-on too a feed keeps the latch shut, and a bite forgets it") {
  Node node;
  node.feed();
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 1);
  node.write(0x0C00, 0x80000000);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 0);
  CHECK_FALSE(node.core.armed);
  node.feed();  // off stays off
  CHECK_FALSE(node.core.armed);
}

TEST_CASE("Switching the armed watchdog off bites, a time below a us too; unarmed nothing is driven; only 5A feeds") {
  Node node;
  node.activate();
  node.set_duty(0, 1000);
  node.write(0x0C00, 0x80000000);
  CHECK(node.read(0x0D00) == 1);
  node.activate();
  node.set_duty(0, 1000);
  CHECK(node.ask("81C2000C01000000 8142000D") == hex("01000000"));
  CHECK(node.duty(0) == 0);
  for (const std::uint32_t clocks : {0U, 98U}) {
    node.activate();
    node.write(0x0C00, clocks);
    CHECK(node.read(0x0D00) == 1);
  }
  node.activate(99);  // 1 us
  CHECK(node.read(0x0D00) == 0);
  node.poll(1);
  CHECK(node.read(0x0D00) == 1);
  node.write(0x0C00, 0x80000000);  // not armed: no effect on the latch
  node.set_duty(0, 0);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x0C00, 0x80000000);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x1100, 2);
  node.set_duty(0, 1000);
  CHECK(node.duty(0) == 0);  // not armed
  node.activate();
  node.poll(4'000);
  node.write(0x0E00, 0x5B000000);
  node.write(0x0E00, 0x005A0000);
  node.poll(5'001);
  CHECK(node.read(0x0D00) == 1);
}

TEST_CASE("A latch that was opened closes again if the watchdog is not armed within 20 ms") {
  for (const std::uint32_t arms_at_us : {19'999U, 20'000U}) {
    Node node;
    node.poll(0xFFFFF000U);  // the clock wraps meanwhile
    for (const std::uint32_t i : {0U, 4U}) {
      node.write(0x1200 + i, 2);
      node.write(0x4100 + i, 3);
    }
    node.write(0x0D00, 0);
    for (const std::uint32_t i : {0U, 4U}) node.write(0x1100 + i, 2);
    node.write(0x4000, 1024U << 16);
    CHECK(node.duty(0) == 0);
    node.poll(0xFFFFF000U + arms_at_us);
    node.write(0x0C00, 499'999);
    node.feed();  // of anybody
    const bool in_time = arms_at_us < 20'000;
    CHECK(node.drives(0) == in_time);
    CHECK(node.duty(0) == (in_time ? 1024 : 0));
    CHECK(node.read(0x0D00) == (in_time ? 0 : 1));
    if (!in_time) CHECK(node.read(0x1100) == 0);
  }
}

namespace {

/// Activated by a host that numbers its datagrams; its last number was 8, and duty 0 is 1024.
struct Owned : Node {
  Owned() {
    activate();
    CHECK(ask("82D1 1400 07000000").empty());
    CHECK(ask("81C2 0040 00000004 82D1 1400 08000000").empty());
    REQUIRE(duty(0) == 1024);
  }
};

}  // namespace

TEST_CASE("While its owner numbers its datagrams, nobody feeds or drives without the next number") {
  for (const char* datagram : {
           "81C2 000E 0000005A",                     // a feed
           "81C2 000C 1FA10700",                     // another time for the watchdog, which loads it
           "81C2 0040 00000005",                     // another duty
           "81C2 0440 00000004",                     // the other duty
           "81C2 0041 02000000",                     // a mode in which the value means another duty
           "81C2 0042 FF000000",                     // another frequency
           "81C2 0011 03000000",                     // a further pin
           "81C2 0040 00000000 81C2 000E 0000005A",  // zero, and a feed
       }) {
    CAPTURE(datagram);
    Owned node;
    node.poll(4'000);
    CHECK(node.ask(datagram).empty());
    CHECK(node.duty(0) == 1024);
    CHECK(node.duty(1) == 0);
    CHECK((node.errors() & 4U) != 0);
    node.poll(5'000);  // the armed time since the owner's last word: nobody has fed
    CHECK_FALSE(node.drives(0));
    Owned numbered;
    numbered.ask(std::string(datagram) + " 82D1 1400 09000000");
    CHECK((numbered.errors() & 4U) == 0);
  }
}

TEST_CASE("Nobody but the owner switches a PWM pin on") {
  Owned node;
  node.ask("81C2 0411 00000000 82D1 1400 09000000");
  REQUIRE_FALSE(node.drives(1));
  node.ask("81C2 0411 02000000");
  CHECK_FALSE(node.drives(1));
  CHECK((node.errors() & 4U) != 0);
}

TEST_CASE("Anybody may make the node safe, and read, also while it has an owner") {
  for (const char* datagram : {"81C2 0040 00000000", "81C2 000C 01000000", "81C2 000C 00000080", "81C2 0011 00000000",
                               "82C2 0040 0000000000000000 81C2 000C 01000000"}) {
    CAPTURE(datagram);
    Owned node;
    CHECK(node.ask(datagram).empty());
    CHECK(node.duty(0) == 0);
    CHECK(node.errors() == 0);
  }
  Owned node;
  CHECK(node.ask("8142 0040").size() == 4);
  CHECK(node.duty(0) == 1024);
}

TEST_CASE("A host that sends no numbers drives as before") {
  Node node;
  node.activate();
  node.set_duty(0, 1024);
  node.poll(4'000);
  node.feed();
  node.poll(8'000);
  CHECK(node.duty(0) == 1024);
  CHECK(node.errors() == 0);
}
