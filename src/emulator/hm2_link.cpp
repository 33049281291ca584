// Faults of the cable between a host and the emulated 7I92.

#include <algorithm>
#include <array>
#include <utility>

#include "emulator/fault_text.hpp"
#include "emulator/udp_board.hpp"

namespace abs_hil::emulator {

void Hm2Link::set(std::string_view text) {
  // In the order of Kind.
  static constexpr std::array<FaultName, 10> names{{{"ok"},
                                                    {"loss=PERCENT", 0, 100},
                                                    {"lose-requests=N", 0, 1e6},
                                                    {"lose-answers=N", 0, 1e6},
                                                    {"delay=US", 0, 1e7},
                                                    {"reorder"},
                                                    {"duplicate"},
                                                    {"stale"},
                                                    {"short=BYTES", 0, 1472},
                                                    {"garbage"}}};
  const auto given = fault_in(text, names);
  if (!given) refuse_fault(text, "one of " + usages_of(names, " "));
  kind_ = static_cast<Kind>(given->place);
  number_ = given->number;
  kept_.reset();
}

void Hm2Link::plug(bool in) {
  plugged_ = in;
  waiting_.clear();
  kept_.reset();
}

bool Hm2Link::lost(Kind counted) {
  if (!plugged_) return true;
  if (kind_ == Kind::loss) return std::uniform_real_distribution<double>(0.0, 100.0)(random_) < number_;
  if (kind_ != counted || number_ < 1.0) return false;
  number_ -= 1.0;
  return true;
}

bool Hm2Link::request_arrives() { return !lost(Kind::lose_requests); }

void Hm2Link::send(Hm2Datagram answer, std::int64_t now_ns) {
  if (lost(Kind::lose_answers)) return;
  const auto leave = [this, now_ns](Hm2Datagram datagram) {
    const auto later_ns = kind_ == Kind::delay ? static_cast<std::int64_t>(number_ * 1000.0) : 0;
    waiting_.push_back({now_ns + later_ns, std::move(datagram)});
  };
  switch (kind_) {
    case Kind::reorder:
      if (!kept_) {
        kept_ = std::move(answer);
        return;
      }
      leave(std::move(answer));
      leave(*std::exchange(kept_, std::nullopt));
      return;
    case Kind::stale:
      if (kept_) std::swap(*kept_, answer);
      if (!kept_) kept_ = answer;
      break;
    case Kind::duplicate: leave(answer); break;
    case Kind::too_short: answer.bytes.resize(std::min(answer.bytes.size(), static_cast<std::size_t>(number_))); break;
    case Kind::garbage:
      for (std::uint8_t& byte : answer.bytes) byte = static_cast<std::uint8_t>(random_());
      break;
    default: break;
  }
  leave(std::move(answer));
}

std::vector<Hm2Datagram> Hm2Link::take_due(std::int64_t now_ns) {
  std::vector<Hm2Datagram> due;
  for (Waiting& waiting : waiting_) {
    if (waiting.due_ns <= now_ns) due.push_back(std::move(waiting.answer));
  }
  std::erase_if(waiting_, [now_ns](const Waiting& waiting) { return waiting.due_ns <= now_ns; });
  return due;
}

std::optional<std::int64_t> Hm2Link::next_due_ns() const noexcept {
  std::optional<std::int64_t> next;
  for (const Waiting& waiting : waiting_) next = std::min(next.value_or(waiting.due_ns), waiting.due_ns);
  return next;
}

}  // namespace abs_hil::emulator
