#pragma once

#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "driver/can/can_driver.hpp"
#include "emulator/can_node.hpp"

namespace abs_hil::test {

/// The emulated node in lock-step at the other end of a socket pair.
class NodeOnSocket {
 public:
  explicit NodeOnSocket(emulator::BoardOptions options) : node_(in_lock_step(std::move(options))) {
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_.data()) != 0) std::abort();
  }
  NodeOnSocket(const NodeOnSocket&) = delete;
  NodeOnSocket& operator=(const NodeOnSocket&) = delete;
  ~NodeOnSocket() {
    thread_ = {};
    for (const int end : ends_) ::close(end);
  }

  /// A new link to the node, with its own socket. The node answers before the driver listens, so that there is no wait
  /// and the result does not depend on the computer's load.
  [[nodiscard]] driver::can::OpenLink opener(bool can_fd = false) {
    return [this, can_fd] { return link(std::make_unique<PromptSocket>(::dup(ends_[0]), *this), can_fd); };
  }
  /// A link to the node in a thread of its own, with which the driver works as with a real one.
  [[nodiscard]] driver::can::OpenLink opener_to_thread() {
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
    return [this] { return link(std::make_unique<driver::can::FrameSocket>(::dup(ends_[0])), false); };
  }
  /// Work with the node once it has taken all that was sent to it so far.
  template <typename Work>
  auto with_node(Work work) {
    const std::scoped_lock lock(mutex_);
    take_all();
    return work(node_, faults_);
  }
  void fault(const std::string& text) {
    with_node([&](emulator::CanNode&, emulator::NodeFaults& faults) { faults.set(text); });
  }
  [[nodiscard]] emulator::Outputs wire() {
    return with_node([](emulator::CanNode& node, emulator::NodeFaults&) { return node.outputs(); });
  }
  /// Sends any frame to the driver, as if from the bus.
  void inject(const void* data, std::size_t size) { static_cast<void>(::send(ends_[1], data, size, MSG_NOSIGNAL)); }
  void inject(const can_frame& frame) { inject(&frame, sizeof frame); }
  /// Sends a frame to the node, like another node on the bus.
  void send_to_node(const emulator::BusFrame& frame) {
    with_node([&](emulator::CanNode& node, emulator::NodeFaults&) { node.receive(frame); });
  }
  /// A frame of another sender on the bus: node and driver both receive it.
  void send_as_other(const driver::can::Frame& frame) {
    const emulator::BusFrame sent = on_bus(frame);
    send_to_node(sent);
    send(sent);
  }
  /// The same, but the driver's controller misses it.
  void send_to_node(const driver::can::Frame& frame) { send_to_node(on_bus(frame)); }
  /// Closes the driver's end of the pair.
  void hang_up() { ::shutdown(ends_[1], SHUT_RDWR); }

 private:
  static emulator::BusFrame on_bus(const driver::can::Frame& frame) {
    return {.id = frame.id, .length = frame.length, .fd = frame.fd, .data = frame.data};
  }
  class PromptSocket final : public driver::can::FrameSocket {
   public:
    PromptSocket(int descriptor, NodeOnSocket& node) : FrameSocket(descriptor), node_(node) {}
    driver::IoResult receive(driver::can::Frame& frame, std::int64_t /*deadline_ns*/) noexcept override {
      node_.with_node([](emulator::CanNode&, emulator::NodeFaults&) {});
      return FrameSocket::receive(frame, 0);
    }

   private:
    NodeOnSocket& node_;
  };
  static driver::can::Link link(std::unique_ptr<driver::can::FrameSocket> socket, bool can_fd) {
    return {.socket = std::move(socket), .place = "socket pair", .can_fd = can_fd};
  }
  static emulator::BoardOptions in_lock_step(emulator::BoardOptions options) {
    options.lock_step = true;
    return options;
  }
  void serve(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      pollfd waiting{ends_[1], POLLIN, 0};
      if (::poll(&waiting, 1, 20) <= 0) continue;
      const std::scoped_lock lock(mutex_);
      if (!take_all()) return;
    }
  }
  /// False once the pair is closed.
  bool take_all() {
    for (;;) {
      canfd_frame raw{};
      const ssize_t size = ::recv(ends_[1], &raw, sizeof raw, MSG_DONTWAIT);
      if (size == 0) return false;
      if (size < 0) return true;
      emulator::BusFrame frame{.id = raw.can_id, .length = raw.len, .fd = size == CANFD_MTU};
      std::memcpy(frame.data.data(), raw.data, sizeof raw.data);
      if (!faults_.hears(frame)) continue;
      node_.receive(frame);
      for (const emulator::BusFrame& answer : faults_.answer(node_.take_answers())) send(answer);
    }
  }
  void send(const emulator::BusFrame& frame) {
    canfd_frame raw{};
    raw.can_id = frame.id;
    raw.len = frame.length;
    std::memcpy(raw.data, frame.data.data(), sizeof raw.data);
    inject(&raw, frame.fd ? CANFD_MTU : CAN_MTU);
  }

  std::array<int, 2> ends_{};  ///< driver's, node's
  std::mutex mutex_;
  emulator::CanNode node_;
  emulator::NodeFaults faults_{1};
  std::jthread thread_;
};

}  // namespace abs_hil::test
