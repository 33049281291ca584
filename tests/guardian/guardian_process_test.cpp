// The guardian as a process: hand-over, delays, and the end of its run.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "catch.hpp"
#include "guardian/board_owners.hpp"
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

TEST_CASE("the processes that have a file open, or a socket to a UDP peer, are found and ended") {
  const test::TemporaryFolder folder;
  const std::string file = folder.path / "board";
  std::ofstream(file) << "registers";
  const driver::FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in peer{
      .sin_family = AF_INET, .sin_port = htons(27181), .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
  REQUIRE(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer) == 0);
  const std::vector<std::vector<std::string>> boards{{"udp:0100007F:6A2D"}, {file}, {"udp:0100007F:6A2E"}, {"udp:"}};
  CHECK(owners_of(boards).empty());  // this process is none
  for (const bool by_socket : {true, false}) {
    std::array<int, 2> ready{-1, -1};
    REQUIRE(::pipe(ready.data()) == 0);
    const pid_t owner = ::fork();
    if (owner == 0) {
      std::signal(SIGTERM, SIG_DFL);
      if (!by_socket) ::dup2(::open(file.c_str(), O_RDWR), socket.get());
      static_cast<void>(!::write(ready[1], "", 1));
      ::pause();
      ::_exit(0);
    }
    char byte = 0;
    REQUIRE(::read(ready[0], &byte, 1) == 1);
    auto owners = owners_of(boards);
    REQUIRE(owners.size() == 1);
    CHECK(owners.front().pid == owner);
    CHECK(owners.front().board == (by_socket ? 0 : 1));
    end_owners(owners, [](std::size_t, std::int64_t) { return false; });
    CHECK(owners.front().ended);
    CHECK_FALSE(owners.front().killed);
    CHECK(::waitpid(owner, nullptr, 0) == owner);
    ::close(ready[0]);
    ::close(ready[1]);
  }
}

}  // namespace
}  // namespace abs_hil::guardian
