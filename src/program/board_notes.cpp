#include "program/board_notes.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "driver/factory.hpp"

namespace abs_hil::program {

void BoardNotes::log_once() {
  if (settings_.backend != "rig" || std::exchange(logged_, true)) return;
  for (const std::string& note : driver_.notes()) spdlog::info("{}", note);
  if (const std::string note = driver::verification_note(settings_.driver); !note.empty()) spdlog::warn("{}", note);
}

}  // namespace abs_hil::program
