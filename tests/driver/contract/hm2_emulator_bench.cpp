// The same driver against the emulated 7I92T, or the core of the node's firmware, in another process, over UDP, in
// lock-step.

#include <arpa/inet.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "bench.hpp"
#include "driver/hm2/hm2_driver.hpp"

namespace abs_hil::test {

namespace {

namespace fs = std::filesystem;

#ifdef ABS_HIL_CONTRACT_NODE
constexpr const char* board_option = "--node";
#else
constexpr const char* board_option = "--hm2";
#endif

/// Counts the commands that write to HostMot2.
class CountingLink final : public driver::hm2::Link {
 public:
  CountingLink(const sockaddr_in& board, std::uint64_t& writes) : link_(board), writes_(writes) {}
  int send(std::span<const std::uint8_t> bytes) noexcept override {
    for (std::size_t i = 0; i + 4 <= bytes.size();) {
      const unsigned word = driver::hm2::word16(bytes, i);
      const bool write = (word & 0x8000U) != 0;
      if (write && ((word >> 10U) & 7U) == 0) ++writes_;
      i += 4 + (write ? (word & 0x7FU) << ((word >> 8U) & 3U) : 0U);
    }
    return link_.send(bytes);
  }
  std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept override {
    return link_.receive(buffer, deadline_ns);
  }

 private:
  driver::hm2::UdpLink link_;
  std::uint64_t& writes_;
};

class Hm2EmulatorBench final : public Bench {
 public:
  Hm2EmulatorBench() {
    std::string pattern = (fs::temp_directory_path() / "abs_hil_contract.XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    address_ = driver::hm2::parse_address("127.0.0.1:" + std::to_string(free_port()));
    start();
    driver_ = std::make_unique<driver::hm2::Hm2Driver>(
        driver::hm2::Hm2Options{}, [this] { return std::make_unique<CountingLink>(address_, writes_); }, nullptr, true);
  }
  ~Hm2EmulatorBench() override {
    driver_.reset();
    ::kill(emulator_, SIGTERM);
    ::waitpid(emulator_, nullptr, 0);
    std::fclose(answers_);
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  driver::RigDriver& driver() override { return *driver_; }
  void destroy_driver() override { driver_.reset(); }
  Wire wire() override {
    const std::string answer = command("status");
    Wire wire;
    const std::size_t at = answer.find("drive ");
    if (at == std::string::npos ||
        std::sscanf(answer.c_str() + at, "drive %lf, brake %lf", &wire.drive_duty, &wire.brake_duty) != 2) {
      throw std::runtime_error("no status from the emulator: " + answer);
    }
    return wire;
  }
  std::uint64_t writes() override { return writes_; }
  bool break_brake_output() override {
    command("bite");
    return true;
  }
  bool write_as_other(double drive_duty) override {
    const auto width = static_cast<unsigned>(drive_duty * 4095.0);
    const std::array<std::uint8_t, 8> datagram{
        0x81, 0xC2, 0x00, 0x40, 0, 0, static_cast<std::uint8_t>(width), static_cast<std::uint8_t>(width >> 8U)};
    driver::hm2::UdpLink other(address_);
    return other.send(datagram) == 0;
  }
  [[nodiscard]] int read_back_cycles() const override { return 1; }
  [[nodiscard]] bool tells_health() const override { return false; }

 private:
  static int free_port() {
    const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    const bool bound = ::bind(socket, reinterpret_cast<sockaddr*>(&address), size) == 0 &&
                       ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    ::close(socket);
    if (!bound) throw std::runtime_error("no free port");
    return ntohs(address.sin_port);
  }
  void start() {
    std::array<int, 2> pipe{};
    if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    const std::string place = "127.0.0.1:" + std::to_string(ntohs(address_.sin_port));
    control_ = folder_ / "control";
    emulator_ = ::fork();
    if (emulator_ == 0) {
      ::dup2(pipe[1], STDOUT_FILENO);
      ::execl(ABS_RIG_EMULATOR, ABS_RIG_EMULATOR, board_option, place.c_str(), "--control", control_.c_str(),
              "--lock-step", "--start-speed", "60", static_cast<char*>(nullptr));
      ::_exit(127);
    }
    ::close(pipe[1]);
    answers_ = ::fdopen(pipe[0], "r");
    static_cast<void>(line("ready"));
  }
  /// The emulator's next line with these words; it also tells events.
  std::string line(const std::string& words) {
    std::array<char, 512> text{};
    while (std::fgets(text.data(), text.size(), answers_) != nullptr) {
      if (std::string(text.data()).starts_with(words)) return text.data();
    }
    throw std::runtime_error("the emulator ended without \"" + words + '"');
  }
  std::string command(const std::string& text) {
    std::ofstream(control_) << text << '\n';
    return line(text + ": ");
  }

  fs::path folder_;
  fs::path control_;
  sockaddr_in address_{};
  std::uint64_t writes_{0};
  pid_t emulator_{-1};
  std::FILE* answers_{nullptr};
  std::unique_ptr<driver::RigDriver> driver_;
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<Hm2EmulatorBench>(); }

}  // namespace abs_hil::test
