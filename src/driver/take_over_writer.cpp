#include "driver/take_over_writer.hpp"

#include "driver/monotonic_time.hpp"

namespace abs_hil::driver {

IoResult TakeOverWriter::make_safe() noexcept {
  try {
    if (!driver_) driver_ = make_driver_();
    driver_->configure();
    driver_->activate(monotonic_ns());
    return driver_->deactivate();
  } catch (...) {
    // The board is missing, or its owner still has it: the next call makes a new driver.
    driver_.reset();
    return {IoError::disconnected};
  }
}

}  // namespace abs_hil::driver
