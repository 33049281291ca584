#include "abs_hil/driver/take_over_writer.hpp"

#include <ctime>

namespace abs_hil::driver {

IoResult TakeOverWriter::make_safe() noexcept {
  try {
    if (!driver_) driver_ = make_driver_();
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    driver_->configure();
    driver_->activate(std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec);
    return driver_->deactivate();
  } catch (...) {
    // Not there yet, or still its owner's: the next try begins anew.
    driver_.reset();
    return {IoError::disconnected};
  }
}

}  // namespace abs_hil::driver
