// The messages of a lease between a run and the resident service.
#include "guardian/lease_wire.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <vector>

#include "catch.hpp"
#include "guardian/guard.hpp"
#include "guardian/guardian_lease.hpp"
#include "guardian/linux_process.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::guardian {
namespace {

struct Pair {
  Pair() { REQUIRE(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, fds.data()) == 0); }
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;
  ~Pair() {
    for (const int fd : fds) ::close(fd);
  }
  std::array<int, 2> fds{};
};

TEST_CASE("a message of the lease arrives whole, with its files") {
  const Pair pair;
  const driver::FileDescriptor file(text_in_memory("launch"));
  REQUIRE(send_message(pair.fds[0],
                       {.word = LeaseWord::ready, .scheduling = {81, true}, .safe = true, .text = "lacks nothing"},
                       {file.get(), pair.fds[0]}));
  const auto got = receive_message(pair.fds[1], 0);
  REQUIRE(got);
  CHECK(got->word == LeaseWord::ready);
  CHECK(got->scheduling.fifo_priority == 81);
  CHECK(got->scheduling.memory_locked);
  CHECK(got->safe);
  CHECK(got->text == "lacks nothing");
  REQUIRE(got->files.size() == 2);
  CHECK(text_behind(got->files[0].get()) == "launch");
}

TEST_CASE("what is no message of this build is none") {
  const Pair pair;
  for (const std::string& bytes : {std::string("x"), std::string(100, 'a')}) {
    REQUIRE(::send(pair.fds[0], bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()));
    CHECK_FALSE(receive_message(pair.fds[1], 0));
  }
  CHECK_FALSE(receive_message(pair.fds[1], 0));
}

TEST_CASE("a pidfd tells its process, and nothing else does") {
  const driver::FileDescriptor self(open_pidfd(::getpid()));
  CHECK(process_of(self.get()) == ::getpid());
  const driver::FileDescriptor file(text_in_memory("x"));
  CHECK(process_of(file.get()) == 0);
}

TEST_CASE("without a service there is no lease, and a file in its place is an error") {
  const test::TemporaryFolder folder;
  CHECK(GuardianLease::ask(folder.path / "none.sock", "board") == nullptr);
  CHECK_THROWS_WITH(GuardianLease::ask(std::string(200, 'x'), "board"), Catch::Matchers::Contains("guardian.socket"));
}

TEST_CASE("nobody waits for ever for a service that accepts nobody") {
  const test::TemporaryFolder folder;
  const std::string path = folder.path / "full.sock";
  const driver::FileDescriptor listener(listen_at(path));
  REQUIRE(listener.get() >= 0);
  std::vector<driver::FileDescriptor> queue;
  do {
    queue.emplace_back(connect_to(path, 1'000'000));
  } while (queue.back().get() >= 0 && queue.size() < 1'000);
  CHECK(errno == EAGAIN);
  CHECK(queue.size() > 10);
  CHECK(queue.size() < 1'000);
}

TEST_CASE("a guardian must have what its controller has") {
  using runtime::Scheduling;
  CHECK(Scheduling{81, true}.at_least({80, true}));
  CHECK(Scheduling{80, true}.at_least({80, false}));
  CHECK(Scheduling{0, false}.at_least({0, false}));
  CHECK_FALSE(Scheduling{0, true}.at_least({80, true}));
  CHECK_FALSE(Scheduling{79, true}.at_least({80, true}));
  CHECK_FALSE(Scheduling{81, false}.at_least({80, true}));
}

}  // namespace
}  // namespace abs_hil::guardian
