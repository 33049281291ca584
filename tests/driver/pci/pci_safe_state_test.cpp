// The safe state from a second process: both PWMs are 0, no matter in which access the owner was killed.

#include <algorithm>

#include "catch.hpp"
#include "driver/pci/pci_driver.hpp"
#include "model_card.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using test::ModelCard;
using test::ModelWindow;

namespace {

constexpr rig::Command driving{.motor_duty = 0.9, .motor_enable = true};
constexpr rig::Command braking{.brake_duty = 0.6};

/// Accesses beyond the first `left` ones do not happen: the process is stopped there.
class StoppedWindow final : public pci::RegisterWindow {
 public:
  StoppedWindow(ModelCard& card, int& left) : inner_(card), left_(left) {}
  IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override {
    return left_-- > 0 ? inner_.read32(offset, value) : IoResult{IoError::disconnected};
  }
  IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override {
    return left_-- > 0 ? inner_.write32(offset, value) : IoResult{IoError::disconnected};
  }

 private:
  ModelWindow inner_;
  int& left_;
};

std::unique_ptr<SafeStateWriter> safe_state_of(ModelCard& card) {
  return pci::safe_state_writer([&card] { return std::make_unique<ModelWindow>(card); });
}

bool both_zero(const ModelCard& card) {
  return card.model.outputs().drive_duty == 0.0 && card.model.outputs().brake_duty == 0.0;
}

}  // namespace

TEST_CASE("both PWMs are 0 whichever access of its cycle the owner was killed in, in every phase") {
  for (const rig::Command& before : {rig::safe_command, driving, braking}) {
    for (const rig::Command& command : {rig::safe_command, driving, braking}) {
      for (int accesses = 0; accesses <= static_cast<int>(pci::accesses_per_cycle); ++accesses) {
        ModelCard card;
        int left = 1'000'000;
        {
          const auto own_owner = pci::pci_driver({}, [&card, &left] {
            return pci::Card{.window = std::make_unique<StoppedWindow>(card, left), .place = "test"};
          });
          RigDriver& owner = *own_owner;
          owner.configure();
          owner.activate(0);
          rig::Measurement measurement;
          REQUIRE(owner.read(1'000'000, measurement).ok());
          REQUIRE(owner.write(before).ok());
          left = accesses;
          static_cast<void>(owner.read(2'000'000, measurement));
          static_cast<void>(owner.write(command));
          left = 0;
        }
        const auto guardian = safe_state_of(card);
        guardian->prepare();
        CAPTURE(before.motor_duty, before.brake_duty, command.motor_duty, command.brake_duty, accesses);
        CHECK(guardian->make_safe().ok());
        CHECK(both_zero(card));
      }
    }
  }
}

TEST_CASE("why the owner must be ended first: one that goes on between index and data undoes the safe state") {
  ModelCard card;
  ModelWindow owner(card);
  REQUIRE(owner.write32(0x60, 1).ok());  // index: brake; stopped here
  const auto guardian = safe_state_of(card);
  guardian->prepare();
  REQUIRE(guardian->make_safe().ok());
  REQUIRE(both_zero(card));
  REQUIRE(owner.write32(0x6C, 2000).ok());  // goes on
  CHECK_FALSE(both_zero(card));
}

TEST_CASE("preparing writes nothing") {
  ModelCard card;
  const auto guardian = safe_state_of(card);
  guardian->prepare();
  CHECK(card.traffic.empty());
}

TEST_CASE("a width that does not become 0 does not count as safe, and the other PWM is still written") {
  ModelCard card;
  ModelWindow owner(card);
  for (const std::uint32_t pwm : {0U, 1U}) {
    REQUIRE(owner.write32(0x60, pwm).ok());
    REQUIRE(owner.write32(0x6C, 3000).ok());
  }
  card.faulty.set("6c:wrong=1");
  const auto guardian = safe_state_of(card);
  guardian->prepare();
  const IoResult result = guardian->make_safe();
  CHECK(result.error == IoError::read_back_mismatch);
  CHECK(result.where == 0x6C);
  CHECK(both_zero(card));  // the fault is in the reading
}

TEST_CASE("all ones means a missing card and is not a width") {
  ModelCard card;
  const auto guardian = safe_state_of(card);
  guardian->prepare();
  card.faulty.answer_all_ones(true);
  CHECK(guardian->make_safe().error == IoError::disconnected);
}

TEST_CASE("a card that comes back is opened again") {
  ModelCard card;
  ModelWindow owner(card);
  REQUIRE(owner.write32(0x60, 0).ok());
  REQUIRE(owner.write32(0x6C, 3000).ok());
  int opened = 0;
  const auto guardian = pci::safe_state_writer([&] {
    ++opened;
    if (card.unplugged) throw Unavailable("gone");
    return std::make_unique<ModelWindow>(card);
  });
  guardian->prepare();
  card.unplugged = true;
  CHECK(guardian->make_safe().error == IoError::disconnected);
  CHECK(guardian->make_safe().error == IoError::disconnected);
  card.unplugged = false;
  CHECK(guardian->make_safe().ok());
  CHECK(opened == 3);
  CHECK(both_zero(card));
}

TEST_CASE("Bits above the documented 16 of the PWM registers mean nothing, to the driver and to the safe state") {
  for (const char* fault : {"60:wrong=65536", "64:wrong=65536", "68:wrong=65536", "6c:wrong=65536"}) {
    CAPTURE(fault);
    ModelCard card;
    card.faulty.set(fault);
    const auto own_owner = pci::pci_driver({}, card.opener());
    driver::RigDriver& owner = *own_owner;
    owner.configure();
    owner.activate(0);
    rig::Command sent;
    CHECK(owner.write(driving, sent).ok());
    CHECK(sent.motor_duty == Approx(0.9).margin(1.0 / 4095.0));
    CHECK(owner.deactivate().ok());
    const auto writer = safe_state_of(card);
    writer->prepare();
    CHECK(writer->make_safe().ok());
    CHECK(both_zero(card));
  }
}

TEST_CASE("A look at a card whose outputs are 0 takes four accesses and writes no width") {
  ModelCard card;
  const auto guardian = safe_state_of(card);
  guardian->prepare();
  REQUIRE(guardian->make_safe().ok());
  card.take_traffic();
  CHECK(guardian->verify_safe().ok());
  const std::vector<test::RegisterAccess> look{{true, 0x60, 0}, {false, 0x6C, 0}, {true, 0x60, 1}, {false, 0x6C, 0}};
  CHECK(card.take_traffic() == look);
}

TEST_CASE("A look finds a duty on either output, makes both zero and says that something else has written") {
  const std::uint32_t pwm = GENERATE(0U, 1U);
  ModelCard card;
  const auto guardian = safe_state_of(card);
  guardian->prepare();
  ModelWindow other(card);
  REQUIRE(other.write32(0x60, pwm).ok());
  REQUIRE(other.write32(0x6C, 3000).ok());
  const IoResult found = guardian->verify_safe();
  CHECK(found.error == IoError::foreign_writer);
  CHECK(found.reason == rig::Reason::foreign_writer);
  CHECK(both_zero(card));
  CHECK(guardian->verify_safe().ok());
}

TEST_CASE("A look that cannot tell writes zeros, and its result is theirs") {
  ModelCard card;
  const auto guardian = safe_state_of(card);
  CHECK(guardian->verify_safe().ok());  // opens the card
  card.faulty.answer_all_ones(true);
  CHECK(guardian->verify_safe().error == IoError::disconnected);
  card.faulty.answer_all_ones(false);
  card.unplugged = true;
  CHECK(guardian->verify_safe().error == IoError::disconnected);
  card.unplugged = false;
  card.take_traffic();
  CHECK(guardian->verify_safe().ok());
  CHECK(std::ranges::count(card.traffic, 0x6CU, &test::RegisterAccess::offset) == 4);  // zeros, read back
}

TEST_CASE("it says what it found on, once, and looks only if it is told to") {
  for (const std::uint32_t full_width : {0U, 4095U}) {
    ModelCard card;
    ModelWindow other(card);
    for (const auto& [offset, value] : {std::pair{0x60U, 0U}, {0x6CU, 4095U}, {0x60U, 1U}, {0x6CU, 1365U}}) {
      REQUIRE(other.write32(offset, value).ok());
    }
    const auto writer = pci::safe_state_writer([&card] { return std::make_unique<ModelWindow>(card); }, full_width);
    writer->prepare();
    CHECK(writer->make_safe().ok());
    CHECK(both_zero(card));
    REQUIRE(writer->found().has_value() == (full_width != 0));
    if (full_width == 0) continue;
    CHECK(writer->found()->motor_duty == 1.0);
    CHECK(writer->found()->brake_duty == 1.0 / 3.0);
    CHECK(writer->make_safe().ok());
    CHECK_FALSE(rig::acts(*writer->found()));
  }
}
