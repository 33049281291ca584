// The integral of the slip error is the trapezoid over the time that passed.
#include "control/slip_error_integral.hpp"

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

control::SlipInput after(double dt_s, double unsent_Nm = 0.0) { return {.dt_s = dt_s, .unsent_torque_Nm = unsent_Nm}; }

}  // namespace

TEST_CASE("The integral is the trapezoid over the intervals that really passed") {
  control::SlipErrorIntegral integral;
  integral.reset(-2.0, 0.15);
  CHECK(integral.value_m() == 0.0);
  integral.advance(after(0.0), -2.0, 0.15, 10.0);  // first step: the same measurement as reset
  CHECK(integral.value_m() == 0.0);
  integral.advance(after(0.010), -1.0, 0.15, 10.0);
  CHECK_THAT(integral.value_m(), WithinAbs(-0.015, 1e-15));
  CHECK_THAT(integral.mean_error_m_s(), WithinAbs(-1.5, 1e-15));
  integral.advance(after(0.002), 3.0, 0.15, 10.0);
  CHECK_THAT(integral.value_m(), WithinAbs(-0.013, 1e-15));
  CHECK_THAT(integral.mean_value_m(), WithinAbs(-0.014, 1e-15));
  integral.reset(1.0, 0.15);
  CHECK(integral.value_m() == 0.0);
}

TEST_CASE("A step of the slip reference does not count for the interval before it") {
  control::SlipErrorIntegral integral;
  integral.reset(1.0, 0.15);
  // At v_x = 10 m/s the reference going from 0.15 to 0.05 lifts e_v by 1 m/s: without it e_v would still be 1.
  integral.advance(after(0.1), 2.0, 0.05, 10.0);
  CHECK_THAT(integral.value_m(), WithinAbs(0.1, 1e-15));
  integral.advance(after(0.1), 2.0, 0.05, 10.0);
  CHECK_THAT(integral.value_m(), WithinAbs(0.3, 1e-15));
}

TEST_CASE(
    "The integral stands while the torque sent is not that asked for and e_v would part them further, only then") {
  struct Case {
    double unsent_Nm, error_m_s;
    bool integrates;
  };
  const Case cases[] = {{0.0, -1.0, true}, {0.0, 1.0, true},   {0.5, -1.0, false},
                        {0.5, 1.0, true},  {-0.5, 1.0, false}, {-0.5, -1.0, true}};
  for (const auto& c : cases) {
    CAPTURE(c.unsent_Nm, c.error_m_s);
    control::SlipErrorIntegral integral;
    integral.reset(c.error_m_s, 0.15);
    integral.advance(after(0.01, c.unsent_Nm), c.error_m_s, 0.15, 10.0);
    CHECK_THAT(integral.value_m(), WithinAbs(c.integrates ? 0.01 * c.error_m_s : 0.0, 1e-15));
    // Once all is sent, it goes on at once.
    const double before = integral.value_m();
    integral.advance(after(0.01), c.error_m_s, 0.15, 10.0);
    CHECK_THAT(integral.value_m() - before, WithinAbs(0.01 * c.error_m_s, 1e-15));
  }
}
