// Reading and writing allocate nothing and take no lock, whether frames come or not. What libusb does below the link is
// not ours to promise (docs/usb.md).

#include "../../runtime/proofs/interposed.hpp"
#include "catch.hpp"
#include "driver/usb/usb_driver.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using runtime::test::OffenceCounter;
using runtime::test::Offences;

namespace {

/// A board in fixed memory: shows what was sent, wheels at rest; every tenth frame does not come in time.
class FixedLink final : public usb::FrameLink {
 public:
  explicit FixedLink(bool planted) : planted_(planted) {}
  IoResult send(const usb::Frame& frame) noexcept override {
    shown_ = frame;
    for (std::size_t i = 0; i < 2 * usb::identity_words; ++i) shown_[i] = 0;
    return {};
  }
  IoResult request() noexcept override {
    if (planted_) planted_block_ = std::make_unique<int>(1);
    return {};
  }
  [[nodiscard]] bool answer_outstanding() const noexcept override { return outstanding_; }
  IoResult receive(std::int64_t /*timeout_ns*/, std::span<const std::uint8_t>& bytes) noexcept override {
    outstanding_ = ++received_ % 10 == 0;
    if (outstanding_) return {IoError::no_answer, usb::endpoint_in};
    bytes = shown_;
    return {};
  }
  IoResult flush(std::int64_t /*timeout_ns*/) noexcept override { return {}; }
  void recover() noexcept override {}

 private:
  bool planted_;
  std::unique_ptr<int> planted_block_{};
  usb::Frame shown_{};
  bool outstanding_{false};
  int received_{0};
};

Offences offences_of(bool planted) {
  usb::UsbDriver driver({}, [planted] {
    usb::Board board{.place = "fixed memory"};
    board.link = std::make_unique<FixedLink>(planted);
    return board;
  });
  driver.configure();
  driver.activate(0);
  Offences found;
  bool went_well = true;
  {
    const OffenceCounter counter;
    rig::Measurement measurement;
    for (std::int64_t cycle = 1; cycle <= 1000; ++cycle) {
      went_well = driver.read(cycle * 1'000'000, measurement).ok() && went_well;
      went_well = driver.write({.brake_duty = 0.5}).ok() && went_well;
    }
    went_well = driver.deactivate().ok() && went_well;
    found = counter.so_far();
  }
  CHECK(went_well);
  CHECK(driver.frames_lost() > 50);
  return found;
}

}  // namespace

TEST_CASE("The USB driver's cycle allocates nothing and locks nothing") {
  const Offences found = offences_of(false);
  CHECK(found.allocations == 0);
  CHECK(found.locks == 0);
}

TEST_CASE("A planted allocation below it is found") { CHECK(offences_of(true).allocations >= 1000); }
