// The text of an injected fault: what is parsed, and what is refused.
#include "config/injection.hpp"

#include <cmath>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::config;
using Catch::Matchers::Contains;

TEST_CASE("an injection's text is parsed") {
  const Injection stuck = parse_injection("brake@encoder_upper:stuck+0.2s");
  CHECK(stuck.phase == rig::Phase::brake);
  CHECK(stuck.signal == InjectionSignal::encoder_upper);
  CHECK(stuck.kind == InjectionKind::stuck);
  CHECK(stuck.delay_s == 0.2);
  CHECK(std::isinf(stuck.duration_s));
  const Injection full = parse_injection("any@brake_pwm:slow=20ms+1.5s~250ms");
  CHECK_FALSE(full.phase.has_value());
  CHECK(full.parameter == Approx(0.02));
  CHECK(full.delay_s == 1.5);
  CHECK(full.duration_s == Approx(0.25));
  CHECK(parse_injection("coast@temperature:wrong=-30").parameter == -30.0);
  // What a kind means if no parameter is given.
  CHECK(parse_injection("brake@encoder_lower:wrong").parameter == -1.0);
  CHECK(parse_injection("brake@read:slow").parameter == 0.002);
  CHECK(parse_injection("brake@supply:slow").parameter == 0.05);
  CHECK(parse_injection("brake@write:intermittent").parameter == 0.5);
}

TEST_CASE("every phase, signal and kind has a name that reads back") {
  for (std::size_t s = 0; s < injection_signal_count; ++s) {
    for (std::size_t k = 0; k < injection_kind_count; ++k) {
      for (const char* phase : {"idle", "accelerate", "coast", "brake", "hold", "stopped", "any"}) {
        const std::string text = std::string(phase) + '@' + std::string(name_of(static_cast<InjectionSignal>(s))) +
                                 ':' + std::string(name_of(static_cast<InjectionKind>(k)));
        const Injection injection = parse_injection(text + "+0.1s~0.3s");
        CHECK(static_cast<std::size_t>(injection.signal) == s);
        CHECK(static_cast<std::size_t>(injection.kind) == k);
        CHECK(parse_injection(to_text(injection)) == injection);
      }
    }
  }
}

TEST_CASE("an invalid text is refused with the part, the allowed values and an example") {
  struct Row {
    const char* text;
    const char* part;
    const char* allowed;
  };
  const Row row = GENERATE(values<Row>({
      {"", "\"\"", "known: ok off stuck"},
      {"brake", "\"brake\"", "intermittent"},
      {"encoder_upper:stuck", "encoder_upper", "PHASE@"},
      {"sleep@read:off", "\"sleep\"", "idle accelerate coast brake hold stopped any"},
      {"brake@wheel:off", "\"wheel\"", "encoder_upper encoder_lower encoders stamp"},
      {"brake@read:bent", "\"bent\"", "ok off stuck garbage wrong slow delayed intermittent"},
      {"brake@read:off+soon", "\"soon\"", "0.2s"},
      {"brake@read:off+0.2", "\"0.2\"", "0.2s"},
      {"brake@read:off+-1s", "\"-1s\"", "[0, 600]"},
      {"brake@read:off+nans", "\"nans\"", "[0, 600]"},
      {"brake@read:off~0s", "\"0s\"", "above 0"},
      {"brake@read:off=3", "\"3\"", "read:off takes no parameter"},
      {"brake@encoders:wrong=3", "\"3\"", "encoders:wrong takes no parameter"},
      {"brake@read:intermittent=1.5", "\"1.5\"", "[1e-06, 1]"},
      {"brake@read:delayed=3s", "\"3s\"", "[1e-06, 0.5] s"},
      {"brake@read:delayed=0.1", "\"0.1\"", "50ms"},
      {"brake@encoder_upper:wrong=x", "\"x\"", "[-10, 10]"},
  }));
  CHECK_THROWS_WITH(parse_injection(row.text),
                    Contains(row.part) && Contains(row.allowed) && Contains("brake@encoder_upper:stuck+0.2s"));
}

TEST_CASE("several are separated by commas or blanks; none is no error") {
  CHECK(parse_injections("").empty());
  CHECK(parse_injections(" , ").empty());
  const auto two = parse_injections("brake@read:off, hold@write:off+10ms");
  REQUIRE(two.size() == 2);
  CHECK(two[1].delay_s == Approx(0.01));
  CHECK_THROWS_WITH(parse_injections("brake@read:off,oops"), Contains("oops"));
}
