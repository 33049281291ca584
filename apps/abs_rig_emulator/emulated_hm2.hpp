#pragma once

#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "control.hpp"
#include "driver/file_descriptor.hpp"
#include "emulator/hm2_board.hpp"
#include "emulator/hm2_link.hpp"

namespace abs_hil::program {

/// Options of the emulated 7I92T and of the node.
struct Hm2EmulatorOptions {
  emulator::Hm2Options board{};
  std::string address{};  ///< ADDRESS or ADDRESS:PORT at which it takes datagrams
  bool is_node{false};    ///< the node of docs/node.md instead of a 7I92T
  std::string mac{};      ///< "00:60:1b:16:ab:50"; empty: the default
  std::uint64_t seed{1};
  std::string truth_file{};  ///< CSV of true values that no register shows; empty: none
};

/// The 7I92T or the node behind a UDP socket: time, cable, logs and the control commands.
class EmulatedHm2 {
 public:
  /// Throws std::invalid_argument, or std::runtime_error if the address cannot be bound.
  explicit EmulatedHm2(Hm2EmulatorOptions options);

  /// Descriptor for poll().
  [[nodiscard]] int descriptor() const { return socket_.get(); }
  /// Answers all received datagrams.
  bool serve();
  /// Advances the rig to the current time, in lock-step only the host does, and sends the answers that are due.
  void catch_up();
  /// Time in ns until the next delayed answer; none: there is no such answer.
  [[nodiscard]] std::optional<std::int64_t> next_due_ns() const;
  /// Obeys one control command and returns its answer. Throws std::invalid_argument for an unknown command.
  std::string obey(std::string_view line);
  [[nodiscard]] static std::span<const ControlRow<EmulatedHm2>> rows();
  [[nodiscard]] emulator::UdpBoard& model() noexcept { return *board_; }
  /// Current duties at the power stage and other values, as one line.
  [[nodiscard]] std::string status() const;
  [[nodiscard]] std::string place() const;
  [[nodiscard]] std::string registers() const { return board_->registers_text(); }

 private:
  enum class Talker : std::uint8_t { off, read, write, drive };

  void bind();
  void send_due();
  void log_events();
  void talk();
  void set_talker(const std::string& what);

  Hm2EmulatorOptions options_;
  std::uint32_t ip_{0};
  std::uint16_t port_{emulator::Hm2Board::port};
  std::unique_ptr<emulator::UdpBoard> board_;
  emulator::Hm2Link link_;
  driver::FileDescriptor socket_{-1};
  BoardTime time_;
  OutputFile changes_{};
  Talker talker_{Talker::off};
  std::int64_t talks_ns_{0};
};

}  // namespace abs_hil::program
