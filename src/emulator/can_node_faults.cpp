// Faults of the emulated CAN node: what it does not hear, and how its frames go wrong.
#include <algorithm>
#include <array>
#include <utility>

#include "emulator/can_node.hpp"
#include "emulator/fault_text.hpp"

namespace abs_hil::emulator {

namespace {

// In the order of NodeFaultKind.
constexpr std::array<FaultName, 16> node_faults{{{"ok"},
                                                 {"silent"},
                                                 {"deaf"},
                                                 {"no-deactivate"},
                                                 {"drop=ANSWERS", 0, 100'000, true},
                                                 {"no-status"},
                                                 {"no-outputs"},
                                                 {"stale=N", 0, 127, true},
                                                 {"ahead=N", 0, 127, true},
                                                 {"stuck"},
                                                 {"duplicate"},
                                                 {"swapped"},
                                                 {"wrong-size=BYTES", 0, 8, true},
                                                 {"corrupt"},
                                                 {"nonsense"},
                                                 {"babble=FRAMES", 0, 100, true}}};

bool is_measurement(const BusFrame& frame) { return frame.id >= 0x92 && frame.id <= 0x94; }

/// Byte of the sequence in the node's frames, except ABS_IDENTITY.
std::size_t sequence_place(const BusFrame& frame) { return frame.length - 2U; }

void shift_sequence(BusFrame& frame, unsigned by) {
  if (frame.id == 0x9A) return;
  std::uint8_t& sequence = frame.data[sequence_place(frame)];
  sequence = static_cast<std::uint8_t>(sequence + by);
  seal(frame);
}

}  // namespace

void NodeFaults::set(std::string_view text) {
  const auto given = fault_in(text, node_faults);
  if (!given) refuse_fault(text, "one of " + usages_of(node_faults, " "));
  kind_ = static_cast<NodeFaultKind>(given->place);
  number_ = static_cast<unsigned>(given->number);
  kept_.clear();
}

bool NodeFaults::hears(const BusFrame& frame) const noexcept {
  constexpr std::uint8_t deactivate = 3;
  switch (kind_) {
    case NodeFaultKind::deaf: return frame.id != 0x81;
    case NodeFaultKind::no_deactivate: return frame.id != 0x82 || frame.data[0] != deactivate;
    default: return true;
  }
}

void NodeFaults::prepend_babble(std::vector<BusFrame>& frames) {
  std::vector<BusFrame> all;
  for (unsigned i = 0; i < number_; ++i) {
    BusFrame other{.id = 0x100 + static_cast<std::uint32_t>(random_() % 0x600), .length = 8};
    BusFrame forged{.id = 0x92 + static_cast<std::uint32_t>(random_() % 2), .length = 8};
    for (std::size_t byte = 0; byte < 8; ++byte) {
      other.data[byte] = static_cast<std::uint8_t>(random_());
      forged.data[byte] = static_cast<std::uint8_t>(random_());
    }
    all.push_back(other);
    all.push_back(forged);
  }
  all.insert(all.end(), frames.begin(), frames.end());
  frames = std::move(all);
}

std::vector<BusFrame> NodeFaults::changed(std::vector<BusFrame> frames) {
  using enum NodeFaultKind;
  switch (kind_) {
    case silent: frames.clear(); break;
    case drop:
      if (number_ > 0) frames.clear();
      if (number_ <= 1) {
        kind_ = ok;
      } else {
        --number_;
      }
      break;
    case no_status: std::erase_if(frames, [](const BusFrame& f) { return f.id == 0x90; }); break;
    case no_outputs: std::erase_if(frames, [](const BusFrame& f) { return f.id == 0x91; }); break;
    case stale:
      for (BusFrame& frame : frames) shift_sequence(frame, 256U - number_);
      break;
    case ahead:
      for (BusFrame& frame : frames) shift_sequence(frame, number_);
      break;
    case stuck:
      if (kept_.empty()) kept_ = frames;
      frames = kept_;
      break;
    case duplicate: {
      std::vector<BusFrame> twice;
      for (const BusFrame& frame : frames) twice.insert(twice.end(), 2, frame);
      frames = std::move(twice);
      break;
    }
    case swapped: std::reverse(frames.begin(), frames.end()); break;
    case wrong_size:
      for (BusFrame& frame : frames) frame.length = static_cast<std::uint8_t>(number_);
      break;
    case corrupt:
      for (BusFrame& frame : frames) frame.data[frame.length - 1U] ^= 0x55U;
      break;
    case nonsense:
      for (BusFrame& frame : frames) {
        if (frame.id != 0x92 && frame.id != 0x94) continue;
        frame.data[2] = static_cast<std::uint8_t>(random_());
        seal(frame);
      }
      break;
    case babble: prepend_babble(frames); break;
    case ok:
    case deaf:
    case no_deactivate: break;
  }
  return frames;
}

std::vector<BusFrame> NodeFaults::answer(std::vector<BusFrame> frames) {
  using enum NodeFaultKind;
  const bool to_sync = std::any_of(frames.begin(), frames.end(), is_measurement);
  // Only faults that silence the node or corrupt its frames change the answers to ABS_CONTROL.
  const bool always = kind_ == silent || kind_ == wrong_size || kind_ == corrupt;
  return frames.empty() || (!to_sync && !always) ? frames : changed(std::move(frames));
}

}  // namespace abs_hil::emulator
