// The memory that a run shares with its guard: who may write which part.
#include "guardian/shared_region.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "catch.hpp"
#include "guardian/guard.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;

TEST_CASE("a process reads what another one wrote, also after the writer was killed") {
  SharedRecorder recorder(16);
  const Pages pages;
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    const Pages mine = Pages::as_run(pages.descriptors());
    for (std::uint64_t n = 0; n < 20; ++n) {
      rig::CycleRecord record;
      record.sequence = n;
      recorder.ring().push(record);
    }
    mine.run().cycle_beats.store(20);
    mine.run().stage.store(Stage::handed_over);
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFSIGNALED(status));
  CHECK(pages.run().stage.load() == Stage::handed_over);
  CHECK(pages.run().cycle_beats.load() == 20);
  const auto records = SharedRecorder::attach(recorder.descriptor()).ring().contents();
  REQUIRE(records.size() == 16);
  CHECK(records.front().sequence == 4);
  CHECK(records.back().sequence == 19);
}

TEST_CASE("neither process can shrink or grow what they share") {
  const SharedRecorder recorder(4);
  const Pages pages;
  for (const int fd : {recorder.descriptor(), pages.descriptors().run, pages.descriptors().guard}) {
    CHECK(::ftruncate(fd, 0) != 0);
    CHECK(::ftruncate(fd, 1 << 20) != 0);
  }
}

TEST_CASE("the run cannot write the guard's page") {
  const Pages pages;
  pages.guard().guardian_beats.store(3);
  REQUIRE(pages.refuse_further_writers());
  const int fd = pages.descriptors().guard;
  CHECK(::mmap(nullptr, sizeof(GuardPage), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0) == MAP_FAILED);
  CHECK(::write(fd, "x", 1) < 0);
  CHECK_THROWS(Pages::as_guard(pages.descriptors()));
  CHECK(Pages::as_run(pages.descriptors()).guard().guardian_beats.load() == 3);
  pages.guard().guardian_beats.store(4);  // the guard's own mapping stays writable
  CHECK(pages.guard().guardian_beats.load() == 4);
}

TEST_CASE("the memory of another build, or any other descriptor, is refused before it is mapped") {
  const driver::FileDescriptor other(::memfd_create("other", MFD_ALLOW_SEALING));
  REQUIRE(::ftruncate(other.get(), 65536) == 0);
  CHECK_THROWS_WITH(SharedRecorder::attach(other.get()), Catch::Matchers::Contains("not the flight recorder"));
  REQUIRE(::fcntl(other.get(), F_ADD_SEALS, F_SEAL_SHRINK) == 0);
  CHECK_THROWS_WITH(SharedRecorder::attach(other.get()), Catch::Matchers::Contains("another build"));
  CHECK_THROWS(Pages::as_run({other.get(), other.get()}));
  const driver::FileDescriptor huge(::memfd_create("huge", MFD_ALLOW_SEALING));
  REQUIRE(::ftruncate(huge.get(), off_t{6} << 30) == 0);
  REQUIRE(::fcntl(huge.get(), F_ADD_SEALS, F_SEAL_SHRINK) == 0);
  CHECK_THROWS_WITH(SharedRecorder::attach(huge.get()), Catch::Matchers::Contains("not the flight recorder"));
  CHECK_THROWS(SharedRecorder::attach(-1));
}

TEST_CASE("a launch configuration reads back; other text is refused") {
  LaunchConfig config{.realtime = runtime::RealtimeMode::require, .record_prefix = "/tmp/a b/recorder"};
  config.run.config_json = R"({"a": {"b": "\"x\""}})";
  config.run.names.signals = {"I_m", "zeta_N"};
  const LaunchConfig read = parse_launch_config(to_json(config));
  CHECK(read.run.config_json == config.run.config_json);
  CHECK(read.record_prefix == config.record_prefix);
  CHECK(read.run.names.signals == config.run.names.signals);
  CHECK(read.realtime == config.realtime);
  CHECK_THROWS_WITH(parse_launch_config("{}"), Catch::Matchers::Contains("not a launch configuration"));
  CHECK_THROWS_WITH(parse_launch_config("nonsense"), Catch::Matchers::Contains("not a launch configuration"));
}
