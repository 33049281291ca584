// Once a safe-state writer has its board, it allocates nothing and takes no lock, whether it looks, writes or fails;
// nor while its board is gone and it is not time to look for it.

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <deque>

#include "../runtime/proofs/interposed.hpp"
#include "catch.hpp"
#include "driver/can/can_driver.hpp"
#include "driver/file_descriptor.hpp"
#include "driver/hm2/hm2_driver.hpp"
#include "driver/own_handle_writer.hpp"
#include "driver/pci/pci_driver.hpp"
#include "driver/usb/usb_driver.hpp"
#include "emulator/can_node.hpp"
#include "hm2/register_board.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using runtime::test::OffenceCounter;

namespace {

/// Offences of ten looks and ten writes.
std::uint64_t offences_of(SafeStateWriter& writer) {
  const OffenceCounter counter;
  for (int i = 0; i < 10; ++i) {
    static_cast<void>(writer.verify_safe());
    static_cast<void>(writer.make_safe());
  }
  return counter.so_far().allocations + counter.so_far().locks;
}

/// The card's PWM registers in fixed memory.
struct Widths final : pci::RegisterWindow {
  explicit Widths(bool& answers) : answers_(answers) {}
  IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override {
    value = offset == pci::reg::pwm_index ? index_ : widths_[index_ & 1U];
    return answers_ ? IoResult{} : IoResult{IoError::no_answer, offset};
  }
  IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override {
    (offset == pci::reg::pwm_index ? index_ : widths_[index_ & 1U]) = value;
    return {};
  }
  bool& answers_;
  std::uint32_t index_{0};
  std::array<std::uint32_t, 2> widths_{3000, 3000};
};

/// A USB board that shows what was sent.
struct Echo final : usb::FrameLink {
  explicit Echo(bool& answers) : answers_(answers) {}
  IoResult send(const usb::Frame& frame) noexcept override {
    shown_ = frame;
    return {};
  }
  IoResult request() noexcept override {
    asked_ = true;
    return {};
  }
  [[nodiscard]] bool answer_outstanding() const noexcept override { return asked_; }
  IoResult receive(std::int64_t, std::span<const std::uint8_t>& bytes) noexcept override {
    if (!answers_) return {IoError::no_answer, usb::endpoint_in};
    asked_ = false;
    bytes = shown_;
    return {};
  }
  IoResult flush(std::int64_t) noexcept override { return {}; }
  void recover() noexcept override { asked_ = false; }
  bool& answers_;
  bool asked_{false};
  usb::Frame shown_{};
};

/// Delivers frames that were made before.
struct Recorded final : can::FrameSocket {
  Recorded(int descriptor, std::deque<can::Frame>& frames) : FrameSocket(descriptor), frames_(frames) {}
  IoResult receive(can::Frame& frame, std::int64_t) noexcept override {
    if (next_ == frames_.size()) return {IoError::no_answer};
    frame = frames_[next_++];
    return {};
  }
  std::deque<can::Frame>& frames_;
  std::size_t next_{0};
};

/// What a node answers to ten times a SYNC and a request to deactivate.
std::deque<can::Frame> answers_of_a_node() {
  emulator::CanNode node({});
  std::deque<can::Frame> frames;
  for (std::uint8_t i = 1; i <= 10; ++i) {
    for (const can::Frame& sent :
         {can::frame_of(can::id::sync, {.sequence = i}), can::control_frame(can::Request::deactivate)}) {
      node.receive({.id = sent.id, .length = sent.length, .data = sent.data});
    }
    for (const emulator::BusFrame& answer : node.take_answers()) {
      frames.push_back({.id = answer.id, .length = answer.length, .data = answer.data});
    }
  }
  return frames;
}

/// An hm2 board that describes itself, then shows inputs only, without allocating.
struct HonestThenFixed final : hm2::Link {
  explicit HonestThenFixed(const bool& answers) : answers_(answers) {}
  int send(std::span<const std::uint8_t> bytes) noexcept override {
    size_ = 0;
    if (described_) {
      // The look's answer: its number and a word for each port.
      constexpr std::size_t number_at = 4;
      std::copy_n(bytes.begin() + number_at, 4, answer_.begin());
      size_ = answers_ && bytes.size() == 16 ? 12 : 0;
      return 0;
    }
    const auto answer = board_.handle(bytes);
    std::copy(answer.begin(), answer.end(), answer_.begin());
    size_ = answer.size();
    return 0;
  }
  std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t) noexcept override {
    std::copy_n(answer_.begin(), size_, buffer.begin());
    return std::exchange(size_, 0);
  }
  void end_description() {
    described_ = true;
    answer_ = {};
  }

 private:
  const bool& answers_;
  bool described_{false};
  test::RegisterBoard board_{};
  std::array<std::uint8_t, 1024> answer_{};
  std::size_t size_{0};
};

}  // namespace

TEST_CASE("The hm2 writer, with a board that answers, that does not, and with none") {
  bool answers = true;
  HonestThenFixed* link = nullptr;
  const auto writer = hm2::safe_state_writer({}, [&] {
    auto made = std::make_unique<HonestThenFixed>(answers);
    link = made.get();
    return made;
  });
  writer->prepare();
  link->end_description();
  CHECK(offences_of(*writer) == 0);
  CHECK(writer->verify_safe().ok());
  answers = false;
  CHECK(offences_of(*writer) == 0);
  CHECK(writer->make_safe().error == IoError::no_answer);
  const auto absent = hm2::safe_state_writer({}, []() -> std::unique_ptr<hm2::Link> { return nullptr; });
  CHECK_FALSE(absent->make_safe().ok());
  CHECK(offences_of(*absent) == 0);
}

TEST_CASE("The PCI writer, with a card that answers, that does not, and with none") {
  bool answers = true;
  const auto writer = pci::safe_state_writer([&] { return std::make_unique<Widths>(answers); });
  writer->prepare();
  CHECK(offences_of(*writer) == 0);
  CHECK(writer->verify_safe().ok());
  answers = false;
  CHECK(offences_of(*writer) == 0);
  CHECK(writer->make_safe().error == IoError::no_answer);
  const auto absent = pci::safe_state_writer([] { return std::unique_ptr<pci::RegisterWindow>(); });
  CHECK(offences_of(*absent) == 0);
  CHECK(absent->make_safe().error == IoError::disconnected);
  CHECK_THROWS_AS(absent->prepare(), Unavailable);
}

TEST_CASE("The USB writer, with a board that answers, that does not, and with none") {
  bool answers = true;
  const auto writer = usb::safe_state_writer({}, [&] {
    usb::Board board{};
    board.link = std::make_unique<Echo>(answers);
    return board;
  });
  REQUIRE(writer->make_safe().ok());
  CHECK(offences_of(*writer) == 0);
  CHECK(writer->verify_safe().ok());
  answers = false;
  CHECK(offences_of(*writer) == 0);
  CHECK_FALSE(writer->make_safe().ok());
  const auto absent = usb::safe_state_writer({}, [] { return usb::Board{}; });
  CHECK(offences_of(*absent) == 0);
  CHECK(absent->make_safe().error == IoError::disconnected);
}

TEST_CASE("The CAN writer, with a node that answers, that does not, and with none") {
  std::deque<can::Frame> frames = answers_of_a_node();
  std::array<int, 2> ends{};
  REQUIRE(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) == 0);
  const FileDescriptor other_end(ends[1]);
  const auto writer =
      can::safe_state_writer([&] { return can::Link{.socket = std::make_unique<Recorded>(ends[0], frames)}; }, false);
  writer->prepare();
  CHECK(offences_of(*writer) == 0);
  CHECK(offences_of(*writer) == 0);  // the answers are used up
  CHECK(writer->make_safe().error == IoError::no_answer);
  const auto absent = can::safe_state_writer([] { return can::Link{}; }, true);
  CHECK(offences_of(*absent) == 0);
  CHECK(absent->make_safe().error == IoError::disconnected);
}

TEST_CASE("A board that is gone is looked for every 100 ms, and every 5 ms once its file is there again") {
  static std::int64_t now_ns;
  now_ns = 0;
  const Reopening::ReadClock clock = []() noexcept { return now_ns; };
  const auto times_due = [](Reopening& again) {
    const OffenceCounter counter;
    int due = 0;
    for (int ms = 0; ms < 1000; ++ms, now_ns += 1'000'000) due += again.due() ? 1 : 0;
    return counter.so_far().allocations == 0 ? due : -1;
  };
  Reopening unknown({}, clock);
  CHECK(times_due(unknown) == 10);
  Reopening gone("/nowhere/else", clock);
  CHECK(times_due(gone) == 10);
  gone.found("/");
  CHECK(times_due(gone) == 200);
}
