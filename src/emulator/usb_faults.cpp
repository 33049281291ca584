// Faults of a USB board's transfers.
#include <stdexcept>
#include <string>

#include "emulator/fault_text.hpp"
#include "emulator/usb_board_model.hpp"

namespace abs_hil::emulator {

namespace {

constexpr std::string_view valid_usb_fault =
    "ok, stall in|out [once], length BYTES (0 to 512), silent, late US [COUNT], or garbage";

std::int64_t at_most(std::int64_t most, std::string_view word, std::string_view whole) {
  const auto value = rig::parse_number<std::int64_t>(word);
  if (!value || *value < 0 || *value > most) refuse_fault(whole, valid_usb_fault);
  return *value;
}

}  // namespace

void UsbFaults::set(std::string_view text) {
  std::vector<std::string_view> words = rig::split(text, ' ');
  std::erase(words, "");
  const auto is = [&words](std::string_view name, std::size_t least, std::size_t most) {
    return !words.empty() && words[0] == name && words.size() > least && words.size() <= most + 1;
  };
  constexpr std::int64_t longest_answer = 512;
  constexpr std::int64_t latest_us = 10'000'000;
  if (is("ok", 0, 0)) {
    *this = {};
  } else if (is("stall", 1, 2) && (words[1] == "in" || words[1] == "out") &&
             (words.size() == 2 || words[2] == "once")) {
    (words[1] == "in" ? stall_in : stall_out) = words.size() == 3 ? Stall::once : Stall::on;
  } else if (is("length", 1, 1)) {
    length = static_cast<std::size_t>(at_most(longest_answer, words[1], text));
  } else if (is("silent", 0, 0)) {
    silent = true;
  } else if (is("late", 1, 2)) {
    late_ns = at_most(latest_us, words[1], text) * 1000;
    late_count = words.size() == 3 ? static_cast<std::uint32_t>(at_most(latest_us, words[2], text)) : 0;
  } else if (is("garbage", 0, 0)) {
    garbage = true;
  } else {
    refuse_fault(text, valid_usb_fault);
  }
}

void UsbFaults::spoil(std::vector<std::uint8_t>& answer, std::mt19937_64& random) const {
  if (garbage) {
    for (std::uint8_t& byte : answer) byte = static_cast<std::uint8_t>(random() >> 56U);
  }
  if (length) answer.resize(*length);
}

}  // namespace abs_hil::emulator
