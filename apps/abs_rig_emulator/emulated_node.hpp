// The emulated CAN node on a bus or a socket.

#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "control.hpp"
#include "emulator/can_node.hpp"

namespace abs_hil::program {

/// The emulated node's end of the bus: a raw CAN socket, or for "unix:PATH" a listening AF_UNIX socket of type
/// SOCK_SEQPACKET with one client at a time.
class BusSocket {
 public:
  /// Throws std::runtime_error if the socket cannot be opened.
  explicit BusSocket(const std::string& interface);
  BusSocket(const BusSocket&) = delete;
  BusSocket& operator=(const BusSocket&) = delete;
  ~BusSocket();

  /// Descriptor for poll().
  [[nodiscard]] int descriptor() const noexcept { return client_.get() >= 0 ? client_.get() : listening_.get(); }
  [[nodiscard]] bool can_fd() const noexcept { return can_fd_; }
  /// Takes the next frame; false if there is none.
  [[nodiscard]] bool receive(emulator::BusFrame& frame);
  /// Sends a frame. If that is not possible at once, the frame is lost, as on a blocked bus.
  void send(const emulator::BusFrame& frame);

 private:
  void open_can(const std::string& interface);
  void listen_at(const std::string& path);

  driver::FileDescriptor listening_{};
  driver::FileDescriptor client_{};
  bool can_fd_{true};
  std::string path_{};
};

/// The CAN I/O node on its bus: time, faults, log and the control commands.
class EmulatedNode {
 public:
  /// Throws std::invalid_argument, or std::runtime_error if the bus cannot be opened, which decides about CAN FD.
  EmulatedNode(emulator::CanNodeOptions options, std::uint64_t seed, const std::string& interface);

  [[nodiscard]] int descriptor() const noexcept { return bus_.descriptor(); }
  /// Advances the rig to the current time; in lock-step only ABS_TIME advances it.
  void catch_up();
  /// Answers all received frames.
  bool serve();
  /// Obeys one control command and returns its answer. Throws std::invalid_argument for an unknown command.
  std::string obey(std::string_view line);
  [[nodiscard]] static std::span<const ControlRow<EmulatedNode>> rows();
  [[nodiscard]] emulator::CanNode& model() noexcept { return node_; }
  /// Current duties at the power stage and other values, as one line.
  [[nodiscard]] std::string status() const;

 private:
  void power_on();

  BusSocket bus_;
  emulator::CanNodeOptions options_;
  emulator::CanNode node_;
  emulator::NodeFaults faults_;
  BoardTime time_;
};

}  // namespace abs_hil::program
