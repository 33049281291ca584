// The emulated RT-DAC/USB2, plugged into this computer's virtual host controller.
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "control.hpp"

namespace abs_hil::program {

namespace {

constexpr std::int64_t mid_braking_ns = 300'000'000;

/// The first free port for high speed. The lines are "hs 0000 004 000 ..."; 004 means free.
int free_port(const std::string& controller) {
  std::ifstream status(controller + "/status");
  if (!status) {
    throw std::runtime_error(controller + "/status: " + std::strerror(errno) +
                             "; load the kernel's virtual USB host controller: sudo modprobe vhci_hcd");
  }
  std::string line;
  while (std::getline(status, line)) {
    std::istringstream words(line);
    std::string speed;
    int port = 0;
    int state = 0;
    constexpr int is_free = 4;
    if (words >> speed >> port >> state && speed == "hs" && state == is_free) return port;
  }
  throw std::runtime_error(controller + ": all high-speed ports are in use; detach a device (usbip detach)");
}

/// The board, plugged into this computer's virtual USB host controller (vhci_hcd) through a socket pair.
class EmulatedUsb final : public BoardOf<EmulatedUsb> {
 public:
  /// Plugs the board in.
  explicit EmulatedUsb(const EmulatorOptions& options)
      : BoardOf(options),
        options_(options),
        board_(options.board),
        device_(
            board_, options.identity, options.seed,
            !options.board.lock_step ? emulator::UsbipDevice::GoOnTo() : [this](std::int64_t time_ns) {
              time_.advance(board_, time_ns);
              run_commands_when_braking();
            }) {
    for (const std::string& command : options.when_braking) {
      if (command == "plug")
        throw std::invalid_argument("--when-braking plug: the board is already plugged in; give another");
    }
    plug_in();
  }

  [[nodiscard]] int descriptor() const override { return host_.get(); }
  bool serve() override {
    if (host_.get() < 0) return true;
    catch_up();
    std::array<std::uint8_t, 4096> buffer{};
    const ssize_t got = ::recv(host_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return true;
    if (got <= 0) return false;  // the controller has released it
    std::vector<std::uint8_t> replies;
    device_.receive(std::span(buffer).first(static_cast<std::size_t>(got)), driver::monotonic_ns(), replies);
    send(replies);
    return true;
  }
  void catch_up() override {
    BoardOf::catch_up();
    run_commands_when_braking();
    std::vector<std::uint8_t> replies;
    device_.give_answers(driver::monotonic_ns(), replies);
    send(replies);
  }
  [[nodiscard]] std::string status() const override {
    return fmt::format("{}, frames {}, nonsense {}, JTAG {}", state_text(board_), board_.frames_taken(),
                       board_.nonsense(), device_.jtag_transfers());
  }
  [[nodiscard]] std::string place() const override {
    return fmt::format("board {:04x}:{:04x} \"{}\" at {}", options_.identity.vendor_id, options_.identity.product_id,
                       options_.identity.manufacturer, options_.controller);
  }
  [[nodiscard]] static std::span<const ControlRow<EmulatedUsb>> rows() {
    using Usb = EmulatedUsb;
    using Command = ControlCommand;
    static constexpr std::array<ControlRow<Usb>, 6> all{{
        {"fault KIND", "ok | stall in|out [once] | length BYTES | silent | late US [COUNT] | garbage",
         [](Usb& usb, const Command& c) { usb.device_.faults.set(c.line.substr(c.line.find("fault") + 5)); }, true},
        {"unplug", "the cable; the outputs hold", [](Usb& usb, const Command&) { usb.unplug(); }},
        {"plug", "the cable is plugged in again",
         [](Usb& usb, const Command&) {
           if (usb.host_.get() < 0) usb.plug_in();
         }},
        {"break-brake on|off", "the brake's PWM ignores writes",
         [](Usb& usb, const Command& c) { usb.board_.break_brake(c.on(1)); }},
        estop_row<Usb>,
        turn_row<Usb>,
    }};
    return all;
  }
  [[nodiscard]] emulator::UsbBoardModel& model() noexcept { return board_; }

 private:
  void plug_in() {
    const int port = free_port(options_.controller);
    std::array<int, 2> pair{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
      throw std::runtime_error(std::string("cannot open a socket pair: ") + std::strerror(errno));
    }
    driver::FileDescriptor ours(pair[0]);
    const driver::FileDescriptor kernels(pair[1]);
    constexpr int any_device_id = 0x10002;
    constexpr int high_speed = 3;
    std::ofstream attach(options_.controller + "/attach");
    attach << fmt::format("{} {} {} {}", port, kernels.get(), any_device_id, high_speed) << std::flush;
    if (!attach) {
      throw std::runtime_error(options_.controller + "/attach: cannot be written: " + std::strerror(errno) +
                               "; run abs_rig_emulator as root");
    }
    host_ = std::move(ours);
    device_.reconnect();
    // The kernel reads the descriptors. No program can use the board before the kernel has set a configuration.
    const std::int64_t started_ns = driver::monotonic_ns();
    constexpr std::int64_t longest_ns = 20'000'000'000;
    while (!device_.configured()) {
      pollfd ready{host_.get(), POLLIN, 0};
      static_cast<void>(::poll(&ready, 1, 100));
      if ((ready.revents != 0 && !serve()) || driver::monotonic_ns() - started_ns > longest_ns) {
        throw std::runtime_error(options_.controller + ": the kernel does not accept the board; see dmesg");
      }
    }
  }
  void unplug() {
    host_ = driver::FileDescriptor(-1);  // closing it unplugs the cable
  }
  void send(const std::vector<std::uint8_t>& replies) {
    std::size_t sent = 0;
    while (sent < replies.size() && host_.get() >= 0) {
      const ssize_t part = ::send(host_.get(), replies.data() + sent, replies.size() - sent, MSG_NOSIGNAL);
      if (part < 0 && errno == EINTR) continue;
      if (part <= 0) unplug();
      sent += static_cast<std::size_t>(part > 0 ? part : 0);
    }
  }
  void run_commands_when_braking() {
    if (options_.when_braking.empty()) return;
    if (board_.outputs().brake_duty == 0.0) {
      brake_since_ns_ = -1;
    } else if (brake_since_ns_ < 0) {
      brake_since_ns_ = board_.time_ns();
    } else if (board_.time_ns() - brake_since_ns_ >= mid_braking_ns) {
      for (const std::string& command : std::exchange(options_.when_braking, {})) {
        cli::print("while braking: {}: {}\n", command, obey(command));
      }
      std::fflush(stdout);
    }
  }

  EmulatorOptions options_;
  emulator::UsbBoardModel board_;
  emulator::UsbipDevice device_;
  driver::FileDescriptor host_{-1};
  std::int64_t brake_since_ns_{-1};
};

}  // namespace

BoardKind usb_kind() { return kind_of<EmulatedUsb>("a USB board"); }

}  // namespace abs_hil::program
