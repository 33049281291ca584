#include "emulator/can_node_faults.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "emulator/fault_text.hpp"

namespace abs_hil::emulator {

namespace {

struct Kind {
  std::string_view name;
  NodeFaultKind kind;
  unsigned most;  ///< largest number; 0: takes no number
};
constexpr std::array<Kind, 14> node_faults{{{"ok", NodeFaultKind::ok, 0},
                                            {"silent", NodeFaultKind::silent, 0},
                                            {"deaf", NodeFaultKind::deaf, 0},
                                            {"drop", NodeFaultKind::drop, 100'000},
                                            {"no-status", NodeFaultKind::no_status, 0},
                                            {"stale", NodeFaultKind::stale, 127},
                                            {"ahead", NodeFaultKind::ahead, 127},
                                            {"stuck", NodeFaultKind::stuck, 0},
                                            {"duplicate", NodeFaultKind::duplicate, 0},
                                            {"swapped", NodeFaultKind::swapped, 0},
                                            {"wrong-size", NodeFaultKind::wrong_size, 8},
                                            {"corrupt", NodeFaultKind::corrupt, 0},
                                            {"nonsense", NodeFaultKind::nonsense, 0},
                                            {"babble", NodeFaultKind::babble, 100}}};

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

const char* NodeFaults::known() {
  return "ok silent deaf drop=ANSWERS no-status stale=N ahead=N stuck duplicate swapped wrong-size=BYTES corrupt "
         "nonsense "
         "babble=FRAMES";
}

void NodeFaults::set(std::string_view text) {
  const std::string valid = std::string("one of ") + known();
  const std::size_t equals = text.find('=');
  const std::string_view name = text.substr(0, equals);
  for (const Kind& kind : node_faults) {
    if (kind.name != name) continue;
    unsigned number = 0;
    if ((kind.most > 0) != (equals != std::string_view::npos)) refuse_fault(text, valid);
    if (kind.most > 0) {
      const auto given = number_in<unsigned>(text.substr(equals + 1));
      if (!given || *given > kind.most) refuse_fault(text, valid);
      number = *given;
    }
    kind_ = kind.kind;
    number_ = number;
    kept_.clear();
    return;
  }
  refuse_fault(text, valid);
}

bool NodeFaults::hears(const BusFrame& frame) const noexcept {
  return kind_ != NodeFaultKind::deaf || frame.id != 0x81;
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
    case no_status: std::erase_if(frames, [](const BusFrame& f) { return f.id == 0x90 || f.id == 0x91; }); break;
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
    case deaf: break;
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
