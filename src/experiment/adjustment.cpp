#include "experiment/adjustment.hpp"

namespace abs_hil::experiment {

AdjustmentMailbox::~AdjustmentMailbox() {
  Arrived waiting{};
  while (inbox_.pop(waiting)) delete waiting.controller;
  free_retired();
}

void AdjustmentMailbox::free_retired() {
  control::SlipController* controller = nullptr;
  while (retired_.pop(controller)) delete controller;
}

std::uint32_t AdjustmentMailbox::put(Adjustment adjustment) {
  free_retired();
  if (!inbox_.push({adjustment.kind, last_number_ + 1, adjustment.slip_ref, adjustment.controller.get()})) return 0;
  static_cast<void>(adjustment.controller.release());
  return ++last_number_;
}

}  // namespace abs_hil::experiment
