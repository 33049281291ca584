#pragma once

#include <cerrno>
#include <cstdint>
#include <deque>
#include <memory>
#include <random>
#include <vector>

#include "driver/usb/usb_driver.hpp"
#include "emulator/usb_board_model.hpp"

namespace abs_hil::test {

/// The emulated USB board in this process: no bus, no clock but the driver's.
struct ModelBoard {
  explicit ModelBoard(const emulator::BoardOptions& options = {}) : model(options) {}

  /// Opens the board for the driver; the model must outlive it.
  [[nodiscard]] driver::usb::OpenBoard opener();

  emulator::UsbBoardModel model;
  emulator::UsbFaults faults{};
  std::mt19937_64 random{1};
  bool unplugged{false};
  int late_waits{0};  ///< number of waits before an answer arrives
  int slow_sends{0};  ///< number of frames that the board does not take
  int recoveries{0};
};

/// The bus of the modelled board: an answer shows the board at the moment of its request.
class ModelLink final : public driver::usb::FrameLink {
 public:
  explicit ModelLink(ModelBoard& board) : board_(board) {}

  driver::IoResult send(const driver::usb::Frame& frame) noexcept override {
    if (const auto result = trouble(board_.faults.stall_out, driver::usb::endpoint_out); !result.ok()) return result;
    if (board_.slow_sends > 0) {
      --board_.slow_sends;
      return {driver::IoError::no_answer, driver::usb::endpoint_out};
    }
    static_cast<void>(board_.model.take(frame));
    return {};
  }
  driver::IoResult request() noexcept override {
    if (const auto result = trouble(board_.faults.stall_out, driver::usb::endpoint_out); !result.ok()) return result;
    outstanding_ = true;
    if (board_.model.take(driver::usb::frame_request) != emulator::UsbBoardModel::Taken::request) return {};
    if (board_.faults.silent) return {};
    const auto image = board_.model.image();
    std::vector<std::uint8_t> answer(image.begin(), image.end());
    board_.faults.spoil(answer, board_.random);
    answers_.push_back(std::move(answer));
    return {};
  }
  [[nodiscard]] bool answer_outstanding() const noexcept override { return outstanding_; }
  driver::IoResult receive(std::int64_t /*timeout_ns*/, std::span<const std::uint8_t>& bytes) noexcept override {
    const auto result = trouble(board_.faults.stall_in, driver::usb::endpoint_in);
    if (!result.ok()) {
      outstanding_ = false;
      return result;
    }
    if (answers_.empty() || board_.late_waits > 0) {
      if (board_.late_waits > 0) --board_.late_waits;
      return {driver::IoError::no_answer, driver::usb::endpoint_in};
    }
    outstanding_ = false;
    last_ = std::move(answers_.front());
    answers_.pop_front();
    bytes = last_;
    return {};
  }
  driver::IoResult flush(std::int64_t /*timeout_ns*/) noexcept override {
    return trouble(board_.faults.stall_out, driver::usb::endpoint_out);
  }
  void recover() noexcept override {
    ++board_.recoveries;
    outstanding_ = false;
    answers_.clear();
    for (auto* stall : {&board_.faults.stall_in, &board_.faults.stall_out}) {
      if (*stall == emulator::UsbFaults::Stall::once) *stall = emulator::UsbFaults::Stall::none;
    }
  }

 private:
  [[nodiscard]] driver::IoResult trouble(emulator::UsbFaults::Stall stall, std::uint8_t endpoint) const noexcept {
    if (board_.unplugged) return {driver::IoError::disconnected, endpoint, ENODEV};
    if (stall != emulator::UsbFaults::Stall::none) return {driver::IoError::stalled, endpoint, EPIPE};
    return {};
  }

  ModelBoard& board_;
  bool outstanding_{false};
  std::deque<std::vector<std::uint8_t>> answers_{};
  std::vector<std::uint8_t> last_{};
};

class ModelBoardTime final : public driver::EmulatedTime {
 public:
  explicit ModelBoardTime(ModelBoard& board) : board_(board) {}
  driver::IoResult now(std::int64_t& time_ns) noexcept override {
    time_ns = board_.model.time_ns();
    return {};
  }
  driver::IoResult advance_to(std::int64_t time_ns) noexcept override {
    board_.model.advance_to(time_ns);
    return {};
  }

 private:
  ModelBoard& board_;
};

inline driver::usb::OpenBoard ModelBoard::opener() {
  return [this] {
    driver::usb::Board board{.place = "1209:0001 in this process"};
    board.link = std::make_unique<ModelLink>(*this);
    board.time = std::make_unique<ModelBoardTime>(*this);
    return board;
  };
}

}  // namespace abs_hil::test
