// Publishing on LCM: delivery, losses, URLs that it cannot use.
#include "telemetry/lcm_outlet.hpp"

#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/sample_records.hpp"

namespace abs_hil::telemetry {
namespace {

TEST_CASE("messages published on memq are delivered, in order and complete") {
  LcmOutlet outlet("memq://");
  test::LcmCapture capture(outlet, "ABS_.*");
  MessageStream stream({}, {{0, 0, "paper", "adaptive", "paper-table1", "sim", "{}", "0.1.0"}}, {});
  stream.add(outlet);
  for (std::uint64_t i = 0; i < 200; ++i) stream.consume(test::sample_record(i), 0.0);
  capture.drain();
  const auto messages = capture.captured.all<telemetry_t>("ABS_TELEMETRY");
  REQUIRE(messages.size() == 200);
  for (std::size_t i = 0; i < messages.size(); ++i) REQUIRE(messages[i].sequence == static_cast<std::int64_t>(i));
  CHECK(capture.captured.all<experiment_t>("ABS_EXPERIMENT").size() == 1);
  CHECK(outlet.failures() == 0);
}

TEST_CASE("every message that tcpq cannot deliver for want of a server is counted") {
  LcmOutlet outlet("tcpq://127.0.0.1:1");  // nothing listens on port 1
  MessageStream stream({}, {}, {});
  stream.add(outlet);
  for (std::uint64_t i = 0; i < 2500; ++i) stream.consume(test::sample_record(i), 0.0);
  CHECK(outlet.failures() == 2500 + 3 + 1 + 1);  // telemetry, status, event, experiment
  CHECK(stream.failures() == outlet.failures());
}

TEST_CASE("a URL that LCM cannot use is refused with the reason") {
  CHECK_THROWS_WITH(LcmOutlet("nonsense"), Catch::Matchers::Contains("nonsense"));
  CHECK_THROWS_AS(LcmOutlet("nosuchprovider://x"), LcmError);
  CHECK_THROWS_WITH(LcmOutlet("udpm://10.0.0.1:7667"), Catch::Matchers::Contains("not a multicast address"));
  CHECK_THROWS_WITH(LcmOutlet("tcpq://localhost:7700"), Catch::Matchers::Contains("numeric"));
  CHECK_THROWS_AS(LcmOutlet("file:///nonexistent/dir/x.lcmlog?mode=w"), LcmError);
}

}  // namespace
}  // namespace abs_hil::telemetry
