// Files of results appear whole or not at all.
#include "files/result_file.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "catch.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::files {
namespace {

namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using test::TemporaryFolder;

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void put(const fs::path& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

std::ptrdiff_t files_in(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

TEST_CASE("a result appears whole or not at all, and an older file stays until then") {
  const TemporaryFolder scratch;
  const fs::path path = scratch / "result";
  put(path, "older");
  {
    ResultFile given_up(path, "result");
    given_up.append("half");
    given_up.flush();
    CHECK(content(path) == "older");
  }
  CHECK(content(path) == "older");
  CHECK(files_in(scratch.path) == 1);
  ResultFile first(path, "result");
  first.append("fir");
  first.append("st");
  put(path, "second");  // by another process
  first.commit();
  CHECK(content(path) == "first");
  CHECK(files_in(scratch.path) == 1);
}

TEST_CASE("two results of one process do not go into the same file, nor into one that it reads") {
  const TemporaryFolder scratch;
  put(scratch / "input", "read");
  fs::create_directory(scratch / "recorded");
  put(scratch / "recorded" / "run.csv", "read");
  fs::create_symlink(scratch / "input", scratch / "link");
  note_input(scratch / "input");
  note_input(scratch / "recorded");
  const auto refusal = [](const fs::path& path) -> std::string {
    try {
      ResultFile(path, "result").write("lost");
    } catch (const FileError& error) {
      return error.what();
    }
    return "written";
  };
  CHECK_THAT(refusal(scratch / "link"), Catch::Matchers::Contains("this command reads it"));
  CHECK_THAT(refusal(scratch / "recorded" / ".." / "recorded" / "run.csv"), Catch::Matchers::Contains("reads it"));
  CHECK(content(scratch / "input") == "read");
  {
    const ResultFile first(scratch / "result", "result");
    CHECK_THAT(refusal(scratch / "result"), Catch::Matchers::Contains("another result goes into the same file"));
  }
  CHECK(refusal(scratch / "result") == "written");
}

TEST_CASE("a file that is shown holds what was flushed, with or without its commit") {
  const TemporaryFolder scratch;
  const fs::path path = scratch / "run.csv";
  put(path, "older");
  {
    ResultFile file(path, "CSV file");
    file.append("begun");
    file.flush();
    file.show();
    CHECK(content(path) == "begun");
    file.append(std::string(200'000, '.'));  // larger than the buffer
  }
  CHECK(content(path).size() == 200'005);
  CHECK(files_in(scratch.path) == 1);
}

TEST_CASE("a symbolic link stays, and the file that it names is written") {
  const TemporaryFolder scratch;
  fs::create_directory(scratch / "far");
  put(scratch / "far" / "old", "older");
  fs::create_symlink("far/old", scratch / "link");
  fs::create_symlink("link", scratch / "link of link");
  fs::create_symlink("far/new", scratch / "dangling");
  write_result(scratch / "link of link", "result", "new");
  CHECK(fs::read_symlink(scratch / "link") == "far/old");
  CHECK(content(scratch / "far" / "old") == "new");
  write_result(scratch / "dangling", "result", "first");
  CHECK(fs::is_symlink(scratch / "dangling"));
  CHECK(content(scratch / "far" / "new") == "first");
  fs::create_symlink("circle", scratch / "circle");
  CHECK_THROWS_WITH(ResultFile(scratch / "circle", "result"), Contains("circle"));
  fs::create_symlink("nowhere/file", scratch / "lost");
  CHECK_THROWS_WITH(ResultFile(scratch / "lost", "result"), Contains("nowhere"));
}

TEST_CASE("a pipe receives the bytes and stays a pipe; without a reader it is refused at once") {
  const TemporaryFolder scratch;
  const fs::path path = scratch / "pipe";
  REQUIRE(::mkfifo(path.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(ResultFile(path, "result"), Contains("nobody reads"));
  const int reader = ::open(path.c_str(), O_RDONLY | O_NONBLOCK);
  REQUIRE(reader >= 0);
  write_result(path, "result", "through");
  std::array<char, 16> bytes{};
  CHECK(::read(reader, bytes.data(), bytes.size()) == 7);
  CHECK(std::string(bytes.data()) == "through");
  ::close(reader);
  CHECK(fs::is_fifo(path));
  CHECK(files_in(scratch.path) == 1);
}

TEST_CASE("a device receives the bytes and stays a device, also for root in its own folder") {
  const TemporaryFolder scratch;
  fs::path device = scratch / "full";
  if (::mknod(device.c_str(), S_IFCHR | 0666, makedev(1, 7)) != 0) device = "/dev/full";
  ResultFile file(device, "result");
  CHECK(file.part().empty());
  file.append("lost");
  CHECK_THROWS_WITH(file.commit(), Contains("No space left"));
  CHECK(fs::is_character_file(device));
}

TEST_CASE("folders, sockets and block devices are refused") {
  const TemporaryFolder scratch;
  CHECK_THROWS_WITH(ResultFile(scratch.path, "result"), Contains("directory"));
  CHECK_THROWS_WITH(ResultFile(scratch.path / "", "result"), Contains("directory"));
  CHECK_THROWS_WITH(ResultFile("", "result"), Contains("No such file"));
  const fs::path path = scratch / "socket";
  const int bound = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  REQUIRE(::bind(bound, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  CHECK_THROWS_WITH(ResultFile(path, "result"), Contains("socket"));
  ::close(bound);
  CHECK(fs::is_socket(path));
  const fs::path disk = scratch / "disk";
  if (::mknod(disk.c_str(), S_IFBLK | 0600, makedev(7, 200)) != 0) {
    WARN("no block device here: only root makes one");
    return;
  }
  CHECK_THROWS_WITH(ResultFile(disk, "result"), Contains("block device"));
  CHECK(fs::is_block_file(disk));
}

TEST_CASE("what takes the place of the file meanwhile is not replaced either") {
  const TemporaryFolder scratch;
  const fs::path path = scratch / "result";
  ResultFile file(path, "result");
  fs::create_symlink("elsewhere", path);
  file.append("new");
  CHECK_THROWS_WITH(file.commit(), Contains("taken its place"));
  CHECK(fs::is_symlink(path));
}

TEST_CASE("names of every length are written or refused before anything is written") {
  const TemporaryFolder scratch;
  const fs::path longest = scratch.path / std::string(255, 'n');
  write_result(longest, "result", "whole");
  CHECK(content(longest) == "whole");
  for (const fs::path& path : {scratch.path / std::string(256, 'n'), scratch.path / std::string(5000, 'n')}) {
    try {
      ResultFile file(path, "result");
      FAIL("a name that is too long must be refused");
    } catch (const FileError& error) {
      CHECK(error.error_number() == ENAMETOOLONG);
      CHECK_THAT(error.what(), Contains("255 bytes"));
    }
  }
  CHECK_THROWS_WITH(ResultFile(scratch / "nowhere" / "result", "result"), Contains("mkdir -p"));
  CHECK_THROWS_WITH(ResultFile("/dev/null/result", "result"), Contains("choose another path"));
  CHECK(files_in(scratch.path) == 1);
}

TEST_CASE("a file keeps its permissions, and one that may not be written is not replaced") {
  const TemporaryFolder scratch;
  const fs::path path = scratch / "secret";
  put(path, "older");
  fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
  write_result(path, "result", "new");
  CHECK(fs::status(path).permissions() == (fs::perms::owner_read | fs::perms::owner_write));
  if (::geteuid() == 0) return;  // root may write everything
  fs::permissions(path, fs::perms::owner_read);
  CHECK_THROWS_WITH(write_result(path, "result", "newer"), Contains("Permission denied"));
  CHECK(content(path) == "new");
}

}  // namespace
}  // namespace abs_hil::files
