// Finding and claiming the one PCI card, in a made-up tree of devices.
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>

#include "abs_hil/driver/io_result.hpp"
#include "catch.hpp"
#include "driver/pci/wire.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::pci;
namespace fs = std::filesystem;

namespace {

/// A tree of ordinary files that looks like /sys/bus/pci/devices.
class Tree {
  abs_hil::test::TemporaryFolder folder_{};

 public:
  Tree() { options.root = root.string(); }
  void add(const std::string& bdf, const std::string& vendor = "0x10b5", const std::string& device = "0x2497") const {
    fs::create_directories(root / bdf);
    put(bdf, "vendor", vendor + "\n");
    put(bdf, "device", device + "\n");
    put(bdf, "enable", "1\n");
    bar(bdf, "0x000000000000e000 0x000000000000e0ff 0x0000000000040101");
    put(bdf, "resource2", std::string(256, '\0'));
  }
  void bar(const std::string& bdf, const std::string& line) const {
    const std::string none = "0x0000000000000000 0x0000000000000000 0x0000000000000000\n";
    put(bdf, "resource", none + none + line + "\n" + none);
  }
  void put(const std::string& bdf, const std::string& file, const std::string& text) const {
    std::ofstream(root / bdf / file) << text;
  }

  const fs::path& root = folder_.path;
  PciOptions options{};
};

std::string refusal(const PciOptions& options, bool lock_step = false) {
  try {
    static_cast<void>(open_card(options, lock_step));
  } catch (const Unavailable& error) {
    return error.what();
  }
  return "opened";
}

using Catch::Matchers::Contains;

}  // namespace

TEST_CASE("The one card among other devices is found, opened and read") {
  const Tree tree;
  tree.add("0000:00:02.0", "0x8086", "0x1234");
  tree.add("0000:04:01.0");
  tree.add("0000:05:00.0", "0x10b5", "0x9030");
  CHECK(find_cards(tree.root) == std::vector<std::string>{"0000:04:01.0"});
  const Card card = open_card(tree.options, false);
  CHECK(card.time == nullptr);
  REQUIRE(card.window->write32(0x6C, 0x01020304).ok());
  std::uint32_t value = 0;
  REQUIRE(card.window->read32(0x6C, value).ok());
  CHECK(value == 0x01020304);
  std::ifstream file(tree.root / "0000:04:01.0" / "resource2", std::ios::binary);
  file.seekg(0x6C);
  CHECK(file.get() == 4);  // little-endian, at the register's offset
}

TEST_CASE("Each fault is refused with its own message") {
  Tree tree;
  CHECK_THAT(refusal(tree.options), Contains("no RT-DAC4/PCI card") && Contains(tree.root.string()));
  tree.add("0000:04:01.0");

  SECTION("no such folder") {
    tree.options.root += "/nowhere";
    CHECK_THAT(refusal(tree.options), Contains("cannot look for PCI devices") && Contains("driver.pci.root"));
  }
  SECTION("several cards") {
    tree.add("0000:05:01.0");
    CHECK_THAT(refusal(tree.options),
               Contains("2 cards") && Contains("0000:04:01.0, 0000:05:01.0") && Contains("driver.pci.bdf="));
    tree.options.bdf = "0000:05:01.0";
    CHECK(refusal(tree.options) == "opened");
  }
  SECTION("address of nothing") {
    tree.options.bdf = "0000:09:00.0";
    CHECK_THAT(refusal(tree.options), Contains("no PCI device 0000:09:00.0"));
  }
  SECTION("address of another device") {
    tree.add("0000:00:02.0", "0x8086", "0x1234");
    tree.options.bdf = "0000:00:02.0";
    CHECK_THAT(refusal(tree.options), Contains("0x8086:0x1234"));
  }
  SECTION("memory BAR") {
    tree.bar("0000:04:01.0", "0x00000000f7000000 0x00000000f70000ff 0x0000000000040200");
    CHECK_THAT(refusal(tree.options), Contains("is memory, not I/O ports"));
  }
  SECTION("small BAR") {
    tree.bar("0000:04:01.0", "0x000000000000e000 0x000000000000e07f 0x0000000000040101");
    CHECK_THAT(refusal(tree.options), Contains("has 128 bytes; the register map needs 256"));
  }
  SECTION("small file behind a BAR that claims more") {
    tree.put("0000:04:01.0", "resource2", std::string(64, '\0'));
    CHECK_THAT(refusal(tree.options), Contains("has 64 bytes"));
  }
  SECTION("BAR that has no address") {
    tree.bar("0000:04:01.0", "0x0000000000000000 0x00000000000000ff 0x0000000020040101");
    CHECK_THAT(refusal(tree.options),
               Contains("are not assigned: an access would reach other devices") && Contains("nothing was written"));
    tree.bar("0000:04:01.0", "0x000000000000e000 0x000000000000e0ff 0x0000000020040101");
    CHECK_THAT(refusal(tree.options), Contains("are not assigned"));
    CHECK_THROWS_WITH(open_beside_owner(tree.options), Contains("are not assigned"));
  }
  SECTION("BAR that the kernel has switched off") {
    tree.bar("0000:04:01.0", "0x000000000000e000 0x000000000000e0ff 0x0000000010040101");
    CHECK_THAT(refusal(tree.options), Contains("are disabled: an access would reach other devices"));
  }
  SECTION("disabled device") {
    tree.put("0000:04:01.0", "enable", "0\n");
    CHECK_THAT(refusal(tree.options), Contains("not enabled; nothing was written. echo 1 | sudo tee "));
    CHECK_NOTHROW(open_beside_owner(tree.options));  // it may still take the zeros
    fs::remove(tree.root / "0000:04:01.0" / "enable");
    CHECK_THAT(refusal(tree.options), Contains("not enabled"));
  }
  SECTION("bound driver") {
    fs::create_symlink("../drivers/uio_pci_generic", tree.root / "0000:04:01.0" / "driver");
    CHECK_THAT(refusal(tree.options),
               Contains("owned by the kernel driver uio_pci_generic") && Contains("/driver/unbind"));
    CHECK_NOTHROW(open_beside_owner(tree.options));  // nothing keeps the zeros from the card
  }
  SECTION("no BAR 2") {
    tree.bar("0000:04:01.0", "0x0000000000000000 0x0000000000000000 0x0000000000000000");
    CHECK_THAT(refusal(tree.options), Contains("BAR 2 is missing"));
  }
  SECTION("no table of regions") {
    tree.bar("0000:04:01.0", "nonsense");
    CHECK_THAT(refusal(tree.options), Contains("\"nonsense\" is not a region"));
    fs::remove(tree.root / "0000:04:01.0" / "resource");
    CHECK_THAT(refusal(tree.options), Contains("cannot be read as far as BAR 2"));
  }
  SECTION("no resource file") {
    fs::remove(tree.root / "0000:04:01.0" / "resource2");
    CHECK_THAT(refusal(tree.options), Contains("cannot be opened: No such file"));
  }
}

TEST_CASE("A card has one owner; a second one is told the owner, and gets the card once it is free") {
  const Tree tree;
  tree.add("0000:04:01.0");
  {
    const Card first = open_card(tree.options, false);
    CHECK_THAT(refusal(tree.options),
               Contains("in use by process " + std::to_string(::getpid())) && Contains("only one owner"));
  }
  CHECK(refusal(tree.options) == "opened");
}

TEST_CASE("A guardian runs beside the owner and keeps other processes away from the card") {
  const Tree tree;
  tree.add("0000:04:01.0");
  std::array<int, 2> to_parent{};
  std::array<int, 2> to_child{};
  REQUIRE(::pipe(to_parent.data()) == 0);
  REQUIRE(::pipe(to_child.data()) == 0);
  const pid_t guardian = ::fork();
  if (guardian == 0) {  // nothing of Catch's in here
    ::close(to_child[1]);
    char byte = 'r';
    try {
      const auto window = open_beside_owner(tree.options);
      if (!window->write32(0x6C, 0).ok()) byte = 'w';
      static_cast<void>(::write(to_parent[1], &byte, 1));
      static_cast<void>(::read(to_child[0], &byte, 1));  // until the parent closes its end
    } catch (...) {
      byte = 'x';
      static_cast<void>(::write(to_parent[1], &byte, 1));
    }
    ::_exit(0);
  }
  REQUIRE(guardian > 0);
  char byte = 0;
  REQUIRE(::read(to_parent[0], &byte, 1) == 1);
  CHECK(byte == 'r');
  const std::string told = "process " + std::to_string(guardian);
  CHECK_THAT(refusal(tree.options), Contains(told) && Contains("still brings the card into the safe state"));
  CHECK_THROWS_WITH(open_beside_owner(tree.options), Contains(told) && Contains("still brings the card"));

  ::close(to_child[1]);
  REQUIRE(::waitpid(guardian, nullptr, 0) == guardian);
  for (const int fd : {to_child[0], to_parent[0], to_parent[1]}) ::close(fd);
  const Card owner = open_card(tree.options, false);
  const auto beside = open_beside_owner(tree.options);
  std::uint32_t value = 1;
  CHECK(beside->read32(0x6C, value).ok());
  CHECK(value == 0);
}

TEST_CASE("Lock-step works only with an emulator in lock-step") {
  const Tree tree;
  tree.add("0000:04:01.0");
  CHECK_THAT(refusal(tree.options, true), Contains("keeps its own time: it is hardware"));
  tree.put("0000:04:01.0", emulated_time_file, std::string(8, '\0'));
  CHECK_THAT(refusal(tree.options, false), Contains("emulator in lock-step"));
  Card card = open_card(tree.options, true);
  REQUIRE(card.time != nullptr);
  REQUIRE(card.time->advance_to(123'456'789'012).ok());
  std::int64_t now_ns = 0;
  REQUIRE(card.time->now(now_ns).ok());
  CHECK(now_ns == 123'456'789'012);
}

TEST_CASE("An access that the kernel truncates means that the card is gone") {
  const Tree tree;
  tree.add("0000:04:01.0");
  const Card card = open_card(tree.options, false);
  fs::resize_file(tree.root / "0000:04:01.0" / "resource2", 0);
  std::uint32_t value = 7;
  const IoResult result = card.window->read32(0x88, value);
  CHECK(result.error == IoError::disconnected);
  CHECK(result.where == 0x88);
  CHECK(value == 7);
  CHECK(io_error_for(ENODEV) == IoError::disconnected);
  CHECK(io_error_for(ENOTCONN) == IoError::disconnected);
  for (const int refused : {EPERM, EACCES}) CHECK(io_error_for(refused) == IoError::access_refused);
  for (const int passing : {EAGAIN, EBUSY, EINTR, ETIMEDOUT}) CHECK(io_error_for(passing) == IoError::no_answer);
}

TEST_CASE("A kernel that is locked down is named before anything is written") {
  const abs_hil::test::TemporaryFolder folder;
  const fs::path devices = folder.path / "sys/bus/pci/devices";
  fs::create_directories(devices / "0000:04:01.0");
  fs::create_directories(folder.path / "sys/kernel/security");
  const auto put = [&](const std::string& file, const std::string& text) {
    std::ofstream(devices / "0000:04:01.0" / file) << text;
  };
  put("vendor", "0x10b5\n");
  put("device", "0x2497\n");
  put("enable", "1\n");
  put("resource", "0x0 0x0 0x0\n0x0 0x0 0x0\n0xe000 0xe0ff 0x40101\n");
  put("resource2", std::string(256, '\0'));
  const PciOptions options{.root = devices.string()};
  CHECK(refusal(options) == "opened");
  for (const char* level : {"none [integrity] confidentiality", "none integrity [confidentiality]"}) {
    std::ofstream(folder.path / "sys/kernel/security/lockdown") << level << '\n';
    CHECK_THAT(refusal(options), Contains("the kernel is locked down (Secure Boot)"));
  }
  std::ofstream(folder.path / "sys/kernel/security/lockdown") << "[none] integrity confidentiality\n";
  CHECK(refusal(options) == "opened");
}
