#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>

#include "control.hpp"
#include "emulator/card_model.hpp"
#include "emulator/register_faults.hpp"
#include "fuse_tree.hpp"

namespace abs_hil::program {

/// Options of the emulator.
struct EmulatorOptions {
  emulator::CardOptions card{};
  std::uint64_t seed{1};
  bool lock_step{false};
  std::string truth_file{};    ///< CSV of true values that no register shows; empty: none
  std::string traffic_file{};  ///< log of every register access; empty: none
};

/// The card behind the tree's files: time, registers, faults, logs and the control commands.
class EmulatedCard final : public FileHandler {
 public:
  /// Throws std::invalid_argument, or std::runtime_error if a file cannot be written.
  explicit EmulatedCard(const EmulatorOptions& options);

  [[nodiscard]] int open(std::string_view name) override;
  [[nodiscard]] int read(std::string_view name, std::uint64_t offset, void* data, std::size_t size) override;
  [[nodiscard]] int write(std::string_view name, std::uint64_t offset, const void* data, std::size_t size) override;
  [[nodiscard]] bool present() const override { return present_; }

  /// Advances the rig to the current time; in lock-step only the client advances it.
  void catch_up() { time_.catch_up(model_); }
  /// Obeys one control command and returns its answer. Throws std::invalid_argument for an unknown command.
  std::string obey(std::string_view line);
  [[nodiscard]] static std::span<const ControlRow<EmulatedCard>> rows();
  [[nodiscard]] emulator::CardModel& model() noexcept { return model_; }
  /// Current duties at the power stage and other values, as one line.
  [[nodiscard]] std::string status() const;
  /// Both PWMs' width registers and their times, as one line.
  [[nodiscard]] std::string widths() const;

 private:
  void record(char direction, std::uint64_t offset, std::uint32_t value);
  void note_change();

  emulator::CardModel model_;
  emulator::FaultyCard faulty_;
  bool present_{true};
  bool permission_denied_{false};
  BoardTime time_;
  OutputFile traffic_{};
  OutputFile changes_{};
  std::pair<std::uint32_t, std::uint32_t> last_widths_{};
};

}  // namespace abs_hil::program
