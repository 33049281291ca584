// The same driver as a user gets it: files of a tree that another process serves through FUSE.

#include <fcntl.h>
#include <signal.h>
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
#include "driver/board_options.hpp"
#include "driver/factory.hpp"

namespace abs_hil::test {

namespace {

namespace fs = std::filesystem;

class PciFuseBench final : public Bench {
 public:
  PciFuseBench() {
    std::string pattern = (fs::temp_directory_path() / "abs_hil_contract.XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    start();
    options_.boards.of<driver::pci::PciOptions>().root = (folder_ / "pci").string();
    driver_ = driver::make_rig_driver(options_, true);
  }
  ~PciFuseBench() override {
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
  std::uint64_t writes() override {
    // A new file closes, and so completes, the one so far.
    std::ifstream so_far(folder_ / ("traffic" + std::to_string(part_)));
    command("record " + (folder_ / ("traffic" + std::to_string(++part_))).string());
    for (std::string line; std::getline(so_far, line);) writes_ += line.starts_with("W ") ? 1 : 0;
    return writes_;
  }
  bool break_brake_output() override {
    command("fault 6c:wrong=1");
    return true;
  }
  bool write_as_other(double drive_duty) override {
    // A process with a descriptor of its own on the same file.
    const pid_t other = ::fork();
    if (other == 0) {
      const int file = ::open((folder_ / "pci" / "0000:03:00.0" / "resource2").c_str(), O_RDWR);
      const std::array<std::uint32_t, 2> values{0, static_cast<std::uint32_t>(drive_duty * 4095.0)};
      const bool written = ::pwrite(file, &values[0], 4, 0x60) == 4 && ::pwrite(file, &values[1], 4, 0x6C) == 4;
      ::_exit(written ? 0 : 1);
    }
    int status = 1;
    ::waitpid(other, &status, 0);
    if (status != 0) throw std::runtime_error("the other writer could not write");
    return true;
  }

 private:
  void start() {
    std::array<int, 2> pipe{};
    if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    const std::string root = (folder_ / "pci").string();
    const std::string fifo = (folder_ / "control").string();
    const std::string traffic = (folder_ / "traffic0").string();
    emulator_ = ::fork();
    if (emulator_ == 0) {
      ::dup2(pipe[1], STDOUT_FILENO);
      ::execl(ABS_RIG_EMULATOR, ABS_RIG_EMULATOR, "--pci-root", root.c_str(), "--control", fifo.c_str(), "--record",
              traffic.c_str(), "--lock-step", "--start-speed", "60", static_cast<char*>(nullptr));
      ::_exit(127);
    }
    ::close(pipe[1]);
    answers_ = ::fdopen(pipe[0], "r");
    if (const std::string ready = answer(); !ready.starts_with("ready")) throw std::runtime_error("emulator: " + ready);
    control_ = fifo;
  }
  std::string answer() {
    std::array<char, 512> line{};
    return std::fgets(line.data(), line.size(), answers_) != nullptr ? line.data() : "";
  }
  std::string command(const std::string& text) {
    std::ofstream(control_) << text << '\n';
    return answer();
  }

  fs::path folder_;
  fs::path control_;
  int part_{0};
  std::uint64_t writes_{0};
  pid_t emulator_{-1};
  std::FILE* answers_{nullptr};
  driver::DriverOptions options_{.emulated = true};
  std::unique_ptr<driver::RigDriver> driver_;
};

}  // namespace

std::unique_ptr<Bench> make_bench() { return std::make_unique<PciFuseBench>(); }

}  // namespace abs_hil::test
