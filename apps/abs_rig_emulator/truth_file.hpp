#pragma once

#include <cstdint>
#include <fstream>
#include <string>

#include "abs_hil/rig/cycle_record.hpp"
#include "emulator/card_model.hpp"

namespace abs_hil::program {

/// Opens an output file of the emulator (truth or traffic). Throws std::runtime_error.
void open_for_writing(std::ofstream& stream, const std::string& file);

/// CSV of true values that the board does not show to the host, one row per ms of the board's time.
class TruthFile {
 public:
  /// `with_trip_flags`: adds a last column, for boards that have them. An empty file name writes nothing. Throws
  /// std::runtime_error.
  TruthFile(const std::string& file, bool with_trip_flags);

  /// Advances the board to `time_ns` and writes every row that is due in between.
  template <typename Board>
  void advance(Board& board, std::int64_t time_ns) {
    while (stream_.is_open() && next_ns_ <= time_ns) {
      board.advance_to(next_ns_);
      write(board.time_ns(), board.plant().truth(), board.outputs());
      if constexpr (requires { board.trip_flags(); }) stream_ << ',' << board.trip_flags();
      stream_ << '\n';
      next_ns_ += period_ns;
    }
    board.advance_to(time_ns);
  }

 private:
  static constexpr std::int64_t period_ns = 1'000'000;
  void write(std::int64_t time_ns, const rig::PlantTruth& truth, const emulator::Outputs& out);

  std::ofstream stream_{};
  std::int64_t next_ns_{0};
};

}  // namespace abs_hil::program
