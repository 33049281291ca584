// What this extra brings to the program: runs with injected faults.
#include "injection/injecting_driver.hpp"
#include "program/extra.hpp"

namespace abs_hil::program {

extern const Extra injection_extra;
const Extra injection_extra{.name = "injection", .begin = injection::begin};

}  // namespace abs_hil::program
