// The parts of an LCM URL, and whether there is a route.
#include <cstdlib>
#include <stdexcept>

#include "catch.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::telemetry {
namespace {

TEST_CASE("a URL is split into provider, network and options") {
  const LcmUrl url = parse_lcm_url("udpm://239.1.2.3:7000?ttl=1&recv_buf_size=100");
  CHECK(url.provider == "udpm");
  CHECK(url.network == "239.1.2.3:7000");
  CHECK(url.options == "ttl=1&recv_buf_size=100");
  CHECK(endpoint_of(url).address == "239.1.2.3");
  CHECK(endpoint_of(url).port == 7000);
}

TEST_CASE("missing parts of a URL get LCM's defaults") {
  for (const char* text : {"udpm://", "udpm://?ttl=0", "udpm://:7667", "udpm://239.255.76.67"}) {
    INFO(text);
    const Endpoint endpoint = endpoint_of(parse_lcm_url(text));
    CHECK(endpoint.address == "239.255.76.67");
    CHECK(endpoint.port == 7667);
  }
  const Endpoint tcpq = endpoint_of(parse_lcm_url("tcpq://"));
  CHECK(tcpq.address == "127.0.0.1");
  CHECK(tcpq.port == 7700);
}

TEST_CASE("an invalid URL is refused with its text") {
  for (const char* text : {"", "udpm", "udpm:/", "://x", "239.255.76.67:7667"}) {
    INFO(text);
    CHECK_THROWS_AS(parse_lcm_url(text), std::invalid_argument);
  }
  for (const char* text : {"udpm://239.255.76.67:0", "udpm://239.255.76.67:65536", "udpm://239.255.76.67:x",
                           "udpm://239.255.76.67:-1", "udpm://239.255.76.67:"}) {
    INFO(text);
    CHECK_THROWS_AS(endpoint_of(parse_lcm_url(text)), std::invalid_argument);
  }
}

TEST_CASE("the default URL stays within this computer unless the environment says otherwise") {
  const char* before = std::getenv("LCM_DEFAULT_URL");
  const std::string saved = before != nullptr ? before : "";
  ::unsetenv("LCM_DEFAULT_URL");
  CHECK(default_lcm_url() == "udpm://239.255.76.67:7667?ttl=0");
  ::setenv("LCM_DEFAULT_URL", "memq://", 1);
  CHECK(default_lcm_url() == "memq://");
  ::setenv("LCM_DEFAULT_URL", saved.c_str(), 1);
  if (before == nullptr) ::unsetenv("LCM_DEFAULT_URL");
}

TEST_CASE("the probe passes other providers with what they need, and refuses what cannot work") {
  CHECK(probe_lcm_route("memq://").usable);
  CHECK(probe_lcm_route("file:///tmp/x?mode=w").usable);
  const RouteProbe tcpq = probe_lcm_route("tcpq://127.0.0.1:7700");
  CHECK(tcpq.usable);
  CHECK_THAT(tcpq.fix, Catch::Matchers::Contains("lcm-tcpq-server"));
  CHECK_FALSE(probe_lcm_route("udpm://lab-pc:7667").usable);
  CHECK_FALSE(probe_lcm_route("udpm://10.0.0.1:7667").usable);
  CHECK_FALSE(probe_lcm_route("udpm://239.255.76.67:99999").usable);
  CHECK_FALSE(probe_lcm_route("").usable);
}

}  // namespace
}  // namespace abs_hil::telemetry
