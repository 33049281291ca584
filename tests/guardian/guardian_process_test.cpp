// The guardian as a process: hand-over, delays, and the end of its run.
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "catch.hpp"
#include "guardian/guard.hpp"
#include "guardian/linux_process.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::guardian {
namespace {

/// A guardian that reports ready and then does nothing, like one that the computer delays.
std::string held_up_guardian(const std::filesystem::path& folder) {
  const std::string program = folder / "abs_guardian";
  const std::string ready = std::to_string(inherited_ready);
  // LeaseMessage{.word = LeaseWord::ready}: magic, word, then zeros.
  std::ofstream(program) << R"(#!/bin/sh
printf '2ael\005\000\000\000\000\000\000\000\000\000\000\000' >&)"
                         << ready << "\nexec " << ready << ">&-\nexec sleep 20\n";
  ::chmod(program.c_str(), S_IRWXU);
  return program;
}

TEST_CASE("handed-over outputs stay handed over until the guardian has read it") {
  const test::TemporaryFolder folder;
  const SharedRecorder recorder(1);
  GuardianProcess guardian(recorder, held_up_guardian(folder.path), "{}");
  guardian.arm({});
  const pid_t pid = guardian.pid();
  guardian.outputs_released(false);
  CHECK(guardian.end() == GuardEnd::insisting);
  CHECK(guardian.pages().run().stage.load() == Stage::handed_over);
  REQUIRE(::kill(pid, SIGKILL) == 0);  // the guardian still ran
}

TEST_CASE("a run cannot forge its guardian's beats by a stray pointer") {
  const SharedRecorder recorder(1);
  GuardianProcess guardian(recorder, "none", "{}");
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGSEGV, SIG_DFL);
    guardian.pages().guard().guardian_beats.store(1);
    ::_exit(0);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFSIGNALED(status));
  CHECK(WTERMSIG(status) == SIGSEGV);
  CHECK(guardian.pages().guard().guardian_beats.load() == 0);
}

TEST_CASE("a guardian that is weaker than its controller is refused") {
  const test::TemporaryFolder folder;
  const SharedRecorder recorder(1);
  GuardianProcess guardian(recorder, held_up_guardian(folder.path), "{}");
  CHECK_THROWS_WITH(guardian.arm({.fifo_priority = 80, .memory_locked = true}),
                    Catch::Matchers::Contains("no SCHED_FIFO") && Catch::Matchers::Contains("setcap"));
  CHECK_FALSE(guardian.armed());
}

TEST_CASE("a guardian that hangs although the outputs are safe is ended") {
  const test::TemporaryFolder folder;
  const SharedRecorder recorder(1);
  GuardianProcess guardian(recorder, held_up_guardian(folder.path), "{}");
  guardian.arm({});
  guardian.outputs_released(true);
  CHECK(guardian.end() == GuardEnd::failed);
  CHECK(guardian.pages().run().stage.load() == Stage::closed);
}

}  // namespace
}  // namespace abs_hil::guardian
