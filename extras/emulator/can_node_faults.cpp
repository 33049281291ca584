// Faults of the emulated CAN node: what it does not hear, and how its frames go wrong.
#include <algorithm>
#include <array>
#include <utility>

#include "emulator/can_node.hpp"
#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

namespace {

using Frames = std::vector<BusFrame>;

bool is_measurement(const BusFrame& frame) { return frame.id >= 0x92 && frame.id <= 0x94; }

void shift_sequences(Frames& frames, unsigned by) {
  for (BusFrame& frame : frames) {
    if (frame.id == 0x9A) continue;  // ABS_IDENTITY has none
    std::uint8_t& sequence = frame.data[frame.length - 2U];
    sequence = static_cast<std::uint8_t>(sequence + by);
    frame.seal();
  }
}

bool is_command(const BusFrame& frame) { return frame.id == 0x81; }
bool is_deactivation(const BusFrame& frame) { return frame.id == 0x82 && frame.data[0] == 3; }

}  // namespace

struct NodeFaults::Row {
  FaultName name;
  void (*change)(NodeFaults&, Frames&){nullptr};  ///< null: the frames stay as they are
  bool always{false};                             ///< it also changes the answers to ABS_CONTROL
  bool (*deaf_to)(const BusFrame&){nullptr};      ///< null: it hears all frames
};

// The first one is no fault: it heals the node.
constexpr std::array<NodeFaults::Row, 16> NodeFaults::rows{{
    {{"ok"}},
    {{"silent"}, [](NodeFaults&, Frames& frames) { frames.clear(); }, true},
    {.name = {"deaf"}, .deaf_to = is_command},  // takes no command, but answers
    {.name = {"no-deactivate"}, .deaf_to = is_deactivation},
    {{"drop=ANSWERS", 0, 100'000, true},  // so many are lost, then ok
     [](NodeFaults& faults, Frames& frames) {
       if (faults.number_ > 0) frames.clear();
       if (faults.number_ <= 1) {
         faults.row_ = 0;
       } else {
         --faults.number_;
       }
     }},
    {{"no-status"}, [](NodeFaults&, Frames& frames) { std::erase_if(frames, [](auto& f) { return f.id == 0x90; }); }},
    {{"no-outputs"}, [](NodeFaults&, Frames& frames) { std::erase_if(frames, [](auto& f) { return f.id == 0x91; }); }},
    {{"stale=N", 0, 127, true},  // sequences behind
     [](NodeFaults& faults, Frames& frames) { shift_sequences(frames, 256U - faults.number_); }},
    {{"ahead=N", 0, 127, true}, [](NodeFaults& faults, Frames& frames) { shift_sequences(frames, faults.number_); }},
    {{"stuck"},  // repeats the answer that it gave when the fault began
     [](NodeFaults& faults, Frames& frames) {
       if (faults.kept_.empty()) faults.kept_ = frames;
       frames = faults.kept_;
     }},
    {{"duplicate"},  // sends every frame twice
     [](NodeFaults&, Frames& frames) {
       Frames twice;
       for (const BusFrame& frame : frames) twice.insert(twice.end(), 2, frame);
       frames = std::move(twice);
     }},
    // Ends its answer with the counters instead of their time.
    {{"swapped"}, [](NodeFaults&, Frames& frames) { std::ranges::reverse(frames); }},
    {{"wrong-size=BYTES", 0, 8, true},
     [](NodeFaults& faults, Frames& frames) {
       for (BusFrame& frame : frames) frame.length = static_cast<std::uint8_t>(faults.number_);
     },
     true},
    {{"corrupt"},  // wrong checksums
     [](NodeFaults&, Frames& frames) {
       for (BusFrame& frame : frames) frame.data[frame.length - 1U] ^= 0x55U;
     },
     true},
    {{"nonsense"},  // random counters
     [](NodeFaults& faults, Frames& frames) {
       for (BusFrame& frame : frames) {
         if (frame.id != 0x92 && frame.id != 0x94) continue;
         frame.data[2] = static_cast<std::uint8_t>(faults.random_());
         frame.seal();
       }
     }},
    {{"babble=FRAMES", 0, 100, true},  // of other identifiers, and as many forged ones of its own, before each answer
     [](NodeFaults& faults, Frames& frames) {
       Frames all;
       for (unsigned i = 0; i < faults.number_; ++i) {
         BusFrame other{.id = 0x100 + static_cast<std::uint32_t>(faults.random_() % 0x600), .length = 8};
         BusFrame forged{.id = 0x92 + static_cast<std::uint32_t>(faults.random_() % 2), .length = 8};
         for (std::size_t byte = 0; byte < 8; ++byte) {
           other.data[byte] = static_cast<std::uint8_t>(faults.random_());
           forged.data[byte] = static_cast<std::uint8_t>(faults.random_());
         }
         all.push_back(other);
         all.push_back(forged);
       }
       frames.insert(frames.begin(), all.begin(), all.end());
     }},
}};

void NodeFaults::set(std::string_view text) {
  std::array<FaultName, rows.size()> names{};
  std::ranges::transform(rows, names.begin(), &Row::name);
  const auto given = fault_in(text, names);
  row_ = given.place;
  number_ = static_cast<unsigned>(given.number);
  kept_.clear();
}

bool NodeFaults::hears(const BusFrame& frame) const noexcept {
  return rows[row_].deaf_to == nullptr || !rows[row_].deaf_to(frame);
}

std::vector<BusFrame> NodeFaults::answer(std::vector<BusFrame> frames) {
  const Row& row = rows[row_];
  // Only faults that silence the node or corrupt its frames change the answers to ABS_CONTROL.
  const bool acts = row.always || std::ranges::any_of(frames, is_measurement);
  if (!frames.empty() && acts && row.change != nullptr) row.change(*this, frames);
  return frames;
}

}  // namespace abs_hil::emulator
