// Reading and writing allocate nothing and take no lock, from the driver down to the system calls, whether frames come
// or not. The kernel's usbfs is replaced by a board in fixed memory; its own calls are counted apart.

#include <linux/ioctl.h>
#include <linux/usbdevice_fs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <string>

#include "../../runtime/proofs/interposed.hpp"
#include "catch.hpp"
#include "driver/usb/usb_driver.hpp"
#include "driver/usb/wire.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using runtime::test::OffenceCounter;
using runtime::test::Offences;

namespace {

enum class Fault : std::uint8_t {
  none,
  late,         ///< every tenth answer misses its cycle
  silent,       ///< no answer
  slow,         ///< the board takes nothing
  stalled_in,   ///< every transfer from the board is refused
  stalled_out,  ///< every transfer to the board is refused
  short_frame,
  unplugged,
};
enum class Planted : std::uint8_t { nothing, allocation, lock };

/// A board in fixed memory: shows what was sent, wheels at rest.
class FixedUsbfs final : public usb::Usbfs {
 public:
  explicit FixedUsbfs(Planted planted) : planted_(planted) {}
  void break_down(Fault fault) { fault_ = fault; }
  [[nodiscard]] int submissions() const { return submissions_; }
  [[nodiscard]] int recoveries() const { return recoveries_; }

  int open(const char* /*node*/) noexcept override { return 3; }
  void close(int /*file*/) noexcept override {}
  std::int64_t read(int /*file*/, std::span<std::uint8_t> bytes) noexcept override {
    static constexpr std::array<std::uint8_t, 32> descriptors{9,    2, 32, 0,    1, 1, 0, 0x80, 50,  // configuration 1
                                                              9,    4, 0,  0,    2, 0, 0, 0,    0,   // interface 0
                                                              7,    5, 2,  0x02, 0, 2, 0, 7,    5,  usb::endpoint_in,
                                                              0x02, 0, 2,  0};  // its endpoints
    if (std::exchange(described_, true)) return 0;
    std::copy(descriptors.begin(), descriptors.end(), bytes.begin());
    return descriptors.size();
  }
  int ioctl(int /*file*/, unsigned long request, void* argument) noexcept override {
    if (request == USBDEVFS_REAPURBNDELAY) return reap(*static_cast<usbdevfs_urb**>(argument));
    if (fault_ == Fault::unplugged) return -ENODEV;
    if (request == USBDEVFS_SUBMITURB) return submit(*static_cast<usbdevfs_urb*>(argument));
    if (request == USBDEVFS_DISCARDURB) return discard(static_cast<usbdevfs_urb*>(argument));
    if (request == USBDEVFS_CLEAR_HALT) ++recoveries_;
    return 0;
  }
  void wait(int /*file*/, std::int64_t timeout_ns) noexcept override { time_ns_ += timeout_ns; }
  std::int64_t now_ns() noexcept override { return time_ns_; }

 private:
  struct Transfer {
    usbdevfs_urb* urb{nullptr};
    bool cancelled{false};
  };

  int submit(usbdevfs_urb& urb) {
    ++submissions_;
    plant();
    under_way_[count_++] = {.urb = &urb};
    return 0;
  }
  void plant() {
    if (planted_ == Planted::allocation) planted_block_ = std::make_unique<int>(1);
    if (planted_ == Planted::lock) const std::lock_guard held(planted_mutex_);
  }
  int discard(const usbdevfs_urb* urb) {
    for (std::size_t i = 0; i < count_; ++i) {
      if (under_way_[i].urb == urb) under_way_[i].cancelled = true;
    }
    return 0;
  }
  /// Ends the first transfer that can end.
  int reap(usbdevfs_urb*& ended) {
    for (std::size_t i = 0; i < count_; ++i) {
      const Transfer transfer = under_way_[i];
      if (!transfer.cancelled && fault_ != Fault::unplugged && !ends(*transfer.urb)) continue;
      if (transfer.cancelled) transfer.urb->status = -ENOENT;
      if (fault_ == Fault::unplugged) transfer.urb->status = -ESHUTDOWN;
      std::copy(under_way_.begin() + static_cast<std::ptrdiff_t>(i) + 1, under_way_.end(),
                under_way_.begin() + static_cast<std::ptrdiff_t>(i));
      --count_;
      ended = transfer.urb;
      return 0;
    }
    return fault_ == Fault::unplugged ? -ENODEV : -EAGAIN;
  }
  bool ends(usbdevfs_urb& urb) {
    urb.status = 0;
    if (urb.endpoint == usb::endpoint_out) {
      if (fault_ == Fault::slow) return false;
      if (fault_ == Fault::stalled_out) {
        urb.status = -EPIPE;
      } else if (urb.buffer_length == int{usb::frame_bytes}) {
        std::memcpy(shown_.data(), urb.buffer, shown_.size());
        std::fill_n(shown_.begin(), 2 * usb::identity_words, std::uint8_t{0});
      } else {
        asked_ = true;
        constexpr std::int64_t too_late_ns = 600'000;  // the driver waits 500 us
        due_ns_ = time_ns_ + (fault_ == Fault::late && ++requests_ % 10 == 0 ? too_late_ns : 0);
      }
      return true;
    }
    if (fault_ == Fault::stalled_in) {
      urb.status = -EPIPE;
      urb.actual_length = 0;
      return true;
    }
    if (!asked_ || fault_ == Fault::silent || time_ns_ < due_ns_) return false;
    asked_ = false;
    urb.actual_length = fault_ == Fault::short_frame ? 100 : int{usb::frame_bytes};
    std::memcpy(urb.buffer, shown_.data(), static_cast<std::size_t>(urb.actual_length));
    return true;
  }

  Planted planted_;
  Fault fault_{Fault::none};
  std::unique_ptr<int> planted_block_{};
  std::mutex planted_mutex_{};
  bool described_{false};
  std::array<Transfer, 9> under_way_{};  ///< more than a link has
  std::size_t count_{0};
  usb::Frame shown_{};
  bool asked_{false};
  int requests_{0};
  std::int64_t due_ns_{0};  ///< of the answer
  int submissions_{0};
  int recoveries_{0};
  std::int64_t time_ns_{0};
};

struct Outcome {
  Offences offences{};
  IoError first_error{IoError::none};  ///< of a cycle
  std::string tally{};
  int submissions{0};
  int recoveries{0};
};

/// 1000 cycles, or as many as go well, and the safe state after them.
Outcome run(Fault fault, Planted planted = Planted::nothing) {
  FixedUsbfs usbfs(planted);
  const auto own = usb::usb_driver({}, [&usbfs] {
    usb::Board board{.place = "fixed memory"};
    board.link = usb::urb_link(usb::UsbDevice{.configuration = 1}, usbfs);
    return board;
  });
  RigDriver& driver = *own;
  driver.configure();
  driver.activate(0);
  Outcome outcome;
  usbfs.break_down(fault);
  const int before = usbfs.submissions();
  {
    const OffenceCounter counter;
    rig::Measurement measurement;
    for (std::int64_t cycle = 1; cycle <= 1000 && outcome.first_error == IoError::none; ++cycle) {
      outcome.first_error = driver.read(cycle * 1'000'000, measurement).error;
      const IoError written = driver.write({.brake_duty = 0.5}).error;
      if (outcome.first_error == IoError::none) outcome.first_error = written;
    }
    outcome.submissions = usbfs.submissions() - before;
    static_cast<void>(driver.deactivate());
    outcome.offences = counter.so_far();
  }
  outcome.tally = driver.tally().front();
  outcome.recoveries = usbfs.recoveries();
  return outcome;
}

}  // namespace

TEST_CASE("The cycle over USB allocates nothing and locks nothing, from the driver to the system calls") {
  const Outcome good = run(Fault::none);
  CHECK(good.first_error == IoError::none);
  CHECK(good.submissions == 3000);
  CHECK(good.offences.allocations == 0);
  CHECK(good.offences.locks == 0);
}

TEST_CASE("Nor does it when frames are late or missing, when transfers fail, or when it recovers") {
  struct Case {
    Fault fault;
    IoError first_error;
    bool recovers;
  };
  for (const Case& c :
       {Case{Fault::late, IoError::none, false}, Case{Fault::silent, IoError::no_answer, true},
        Case{Fault::slow, IoError::no_answer, true}, Case{Fault::stalled_in, IoError::stalled, true},
        Case{Fault::stalled_out, IoError::stalled, true}, Case{Fault::short_frame, IoError::incomplete_answer, true},
        Case{Fault::unplugged, IoError::disconnected, false}}) {
    const Outcome outcome = run(c.fault);
    INFO("fault " << static_cast<int>(c.fault));
    CHECK(outcome.first_error == c.first_error);
    CHECK((outcome.recoveries > 0) == c.recovers);
    CHECK(outcome.offences.allocations == 0);
    CHECK(outcome.offences.locks == 0);
    if (c.fault == Fault::late) {
      constexpr std::string_view before_number = "USB board: ";
      REQUIRE(outcome.tally.starts_with(before_number));
      CHECK(std::stoi(outcome.tally.substr(before_number.size())) > 50);
    }
  }
}

TEST_CASE("A planted allocation and a planted lock below the link are found") {
  CHECK(run(Fault::none, Planted::allocation).offences.allocations >= 3000);
  CHECK(run(Fault::none, Planted::lock).offences.locks >= 3000);
}

TEST_CASE("The functions around the system calls allocate nothing and lock nothing") {
  usb::Usbfs& kernel = usb::kernel_usbfs();
  const int file = kernel.open("/dev/null");
  REQUIRE(file >= 0);
  usbdevfs_urb urb{};
  usbdevfs_urb* ended = nullptr;
  Offences found;
  int refused = 0;
  {
    const OffenceCounter counter;
    for (int i = 0; i < 100; ++i) {
      if (kernel.ioctl(file, USBDEVFS_SUBMITURB, &urb) == -ENOTTY) ++refused;
      if (kernel.ioctl(file, USBDEVFS_DISCARDURB, &urb) == -ENOTTY) ++refused;
      if (kernel.ioctl(file, USBDEVFS_REAPURBNDELAY, &ended) == -ENOTTY) ++refused;
      kernel.wait(file, kernel.now_ns());  // always writable
    }
    found = counter.so_far();
  }
  kernel.close(file);
  CHECK(refused == 300);
  CHECK(found.allocations == 0);
  CHECK(found.locks == 0);
}
