#include "abs_hil/rig/reason.hpp"

#include <set>
#include <string>

#include "abs_hil/rig/phase.hpp"
#include "catch.hpp"

using namespace abs_hil::rig;

TEST_CASE("every known reason has words of its own") {
  std::set<std::string> seen;
  int known = 0;
  for (std::uint16_t number = 0; number < 256; ++number) {
    const std::string text(description(static_cast<Reason>(number)));
    if (text == "unknown reason") continue;
    ++known;
    seen.insert(text);
  }
  CHECK(known >= 20);
  CHECK(seen.size() == static_cast<std::size_t>(known));
}

TEST_CASE("reasons fall into three kinds: going on, asked to stop, fault") {
  CHECK_FALSE(is_fault(Reason::sequence_complete));
  CHECK_FALSE(is_fault(Reason::interrupt_signal));
  CHECK(is_stop_request(Reason::interrupt_signal));
  CHECK(is_stop_request(Reason::stop_command));
  CHECK_FALSE(is_stop_request(Reason::overspeed));
  CHECK(is_fault(Reason::phase_time_limit));
  CHECK(is_fault(Reason::consecutive_overruns));
}

TEST_CASE("phases bear the names of the CSV") {
  const char* names[] = {"idle", "accelerate", "coast", "brake", "hold", "stopped", "fault"};
  for (std::uint8_t i = 0; i < 7; ++i) CHECK(name_of(static_cast<Phase>(i)) == names[i]);
}
