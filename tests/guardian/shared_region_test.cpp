#include "guardian/shared_region.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "catch.hpp"
#include "guardian/launch_config.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;

TEST_CASE("a process reads what another one wrote, also after the writer was killed") {
  SharedRegion region(16);
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    SharedRegion mine = SharedRegion::attach(region.descriptor());
    for (std::uint64_t n = 0; n < 20; ++n) {
      rig::CycleRecord record;
      record.sequence = n;
      mine.recorder().push(record);
    }
    mine.panel().cycle_beats.store(20);
    mine.set_stage(Stage::handed_over);
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFSIGNALED(status));
  CHECK(region.stage() == Stage::handed_over);
  CHECK(region.panel().cycle_beats.load() == 20);
  const auto records = region.recorder().contents();
  REQUIRE(records.size() == 16);
  CHECK(records.front().sequence == 4);
  CHECK(records.back().sequence == 19);
}

TEST_CASE("neither process can shrink the region") {
  const SharedRegion region(4);
  CHECK(::ftruncate(region.descriptor(), 0) != 0);
}

TEST_CASE("a region of another build, or any other descriptor, is refused") {
  const int other = ::memfd_create("other", MFD_ALLOW_SEALING);
  REQUIRE(::ftruncate(other, 65536) == 0);
  CHECK_THROWS_WITH(SharedRegion::attach(other), Catch::Matchers::Contains("not the shared memory of a run"));
  REQUIRE(::fcntl(other, F_ADD_SEALS, F_SEAL_SHRINK) == 0);
  CHECK_THROWS_WITH(SharedRegion::attach(other), Catch::Matchers::Contains("another build"));
  ::close(other);
  CHECK_THROWS(SharedRegion::attach(other));
}

TEST_CASE("a launch configuration reads back; other text is refused") {
  const LaunchConfig config{.config_json = R"({"a": {"b": "\"x\""}})",
                            .experiment = "e",
                            .controller = "c",
                            .plant = "p",
                            .backend = "rig",
                            .version = "1",
                            .signals = {"I_m", "zeta_N"},
                            .realtime = "prefer",
                            .record_prefix = "/tmp/a b/recorder"};
  const LaunchConfig read = parse_launch_config(to_json(config));
  CHECK(read.config_json == config.config_json);
  CHECK(read.record_prefix == config.record_prefix);
  CHECK(read.signals == config.signals);
  CHECK_THROWS_WITH(parse_launch_config("{}"), Catch::Matchers::Contains("not a launch configuration"));
  CHECK_THROWS_WITH(parse_launch_config("nonsense"), Catch::Matchers::Contains("not a launch configuration"));
}
