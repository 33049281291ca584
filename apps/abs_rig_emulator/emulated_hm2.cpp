#include "emulated_hm2.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "driver/monotonic_time.hpp"
#include "emulator/hm2_board.hpp"
#include "emulator/node_board.hpp"

namespace abs_hil::program {

namespace {

constexpr std::int64_t talks_every_ns = 10'000'000;

/// What another program on the network sends.
constexpr std::array<std::uint8_t, 4> reads_the_clock{0x01, 0x51, 0x00, 0x00};
constexpr std::array<std::uint8_t, 8> writes_its_number{0x82, 0xD1, 0x14, 0x00, 0xEF, 0xBE, 0xAD, 0xDE};
constexpr std::array<std::uint8_t, 28> drives_the_brake{
    0x82, 0xC2, 0x00, 0x40, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x32, 0x0B,  // PWM values 0 and 0.7
    0x81, 0xC2, 0x00, 0x0E, 0x00, 0x00, 0x00, 0x5A,                          // reload the watchdog
    0x82, 0xD1, 0x14, 0x00, 0xEF, 0xBE, 0xAD, 0xDE};                         // its write number

emulator::Hm2Options with_address(const Hm2EmulatorOptions& options, std::uint32_t& ip, std::uint16_t& port) {
  const std::string& text = options.address;
  const auto refuse = [&text](const std::string& why) {
    throw std::invalid_argument("address \"" + text + "\": " + why + "; give ADDRESS or ADDRESS:PORT, for example " +
                                "127.0.0.1:27181");
  };
  const std::size_t colon = text.find(':');
  in_addr address{};
  if (::inet_pton(AF_INET, text.substr(0, colon).c_str(), &address) != 1) refuse("not an IPv4 address");
  if (colon != std::string::npos) {
    const char* const end = text.data() + text.size();
    const auto [at, error] = std::from_chars(text.data() + colon + 1, end, port);
    if (error != std::errc() || at != end || port == 0) refuse("the port is not 1 to 65535");
  }
  ip = address.s_addr;
  emulator::Hm2Options board = options.board;
  std::memcpy(board.address.data(), &ip, board.address.size());
  if (!options.mac.empty()) {
    std::array<unsigned, 6> m{};
    int used = 0;
    if (std::sscanf(options.mac.c_str(), "%2x:%2x:%2x:%2x:%2x:%2x%n", &m[0], &m[1], &m[2], &m[3], &m[4], &m[5],
                    &used) != 6 ||
        used != static_cast<int>(options.mac.size())) {
      throw std::invalid_argument("--mac " + options.mac + ": give six bytes, for example 00:60:1b:16:ab:50");
    }
    for (std::size_t i = 0; i < m.size(); ++i) board.mac[i] = static_cast<std::uint8_t>(m[i]);
  }
  return board;
}

std::unique_ptr<emulator::UdpBoard> make_board(const Hm2EmulatorOptions& options, std::uint32_t& ip,
                                               std::uint16_t& port) {
  const emulator::Hm2Options board = with_address(options, ip, port);
  if (options.is_node) return std::make_unique<emulator::NodeBoard>(board);
  return std::make_unique<emulator::Hm2Board>(board);
}

}  // namespace

EmulatedHm2::EmulatedHm2(Hm2EmulatorOptions options)
    : options_(std::move(options)),
      board_(make_board(options_, ip_, port_)),
      link_(options_.seed),
      started_ns_(driver::monotonic_ns()),
      truth_(options_.truth_file, false) {
  bind();
}

void EmulatedHm2::bind() {
  socket_ = driver::FileDescriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port_);
  address.sin_addr.s_addr = ip_;
  if (socket_.get() < 0 || ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error(options_.address + ": " + std::strerror(errno) +
                             "; give an address of this computer and a port that no program uses");
  }
}

void EmulatedHm2::serve() {
  std::array<std::uint8_t, 2048> buffer{};
  for (;;) {
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const ssize_t got =
        ::recvfrom(socket_.get(), buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
    if (got < 0) break;
    if (!link_.request_arrives()) continue;
    if (!options_.board.lock_step) truth_.advance(*board_, driver::monotonic_ns() - started_ns_);
    emulator::Hm2Datagram answer{board_->answer(std::span(buffer).first(static_cast<std::size_t>(got))),
                                 std::uint64_t{from.sin_addr.s_addr} << 16U | from.sin_port};
    if (!answer.bytes.empty()) link_.send(std::move(answer), driver::monotonic_ns());
    send_due();
  }
  log_events();
}

void EmulatedHm2::send_due() {
  for (const emulator::Hm2Datagram& answer : link_.take_due(driver::monotonic_ns())) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = static_cast<std::uint16_t>(answer.peer);
    to.sin_addr.s_addr = static_cast<std::uint32_t>(answer.peer >> 16U);
    static_cast<void>(::sendto(socket_.get(), answer.bytes.data(), answer.bytes.size(), MSG_NOSIGNAL,
                               reinterpret_cast<const sockaddr*>(&to), sizeof to));
  }
}

std::optional<std::int64_t> EmulatedHm2::next_due_ns() const {
  const std::optional<std::int64_t> due = link_.next_due_ns();
  return due ? std::optional(*due - driver::monotonic_ns()) : std::nullopt;
}

void EmulatedHm2::talk() {
  if (talker_ == Talker::off || board_->time_ns() < talks_ns_) return;
  talks_ns_ = board_->time_ns() + talks_every_ns;
  if (talker_ == Talker::read) static_cast<void>(board_->answer(reads_the_clock));
  if (talker_ == Talker::write) static_cast<void>(board_->answer(writes_its_number));
  if (talker_ == Talker::drive) static_cast<void>(board_->answer(drives_the_brake));
}

void EmulatedHm2::catch_up() {
  if (!options_.board.lock_step) truth_.advance(*board_, driver::monotonic_ns() - started_ns_);
  talk();
  send_due();
  log_events();
}

void EmulatedHm2::log_events() {
  for (const emulator::NodeEvent& event : board_->log().take_events()) {
    say(fmt::format("event {:.6f} {}", static_cast<double>(event.time_ns) * 1e-9, event.text));
  }
  const std::int64_t start_ns = options_.board.lock_step ? 0 : started_ns_;
  for (const emulator::OutputChange& change : board_->log().take_changes()) {
    if (!changes_.is_open()) continue;
    changes_ << fmt::format("{} {:.6f} {:.6f}\n", start_ns + change.time_ns, change.now.drive_duty,
                            change.now.brake_duty)
             << std::flush;
  }
}

std::string EmulatedHm2::place() const {
  return fmt::format("{} at {}:{}", options_.board.name, options_.address.substr(0, options_.address.find(':')), port_);
}

std::string EmulatedHm2::status() const {
  const emulator::Outputs out = board_->outputs();
  const auto& state = board_->plant().state();
  return fmt::format(
      "time {:.6f} s, drive {:.4f}, brake {:.4f}, upper {:.2f} rad/s, lower {:.2f} rad/s, {}, pins {}, cable {}, "
      "writes {}",
      static_cast<double>(board_->time_ns()) * 1e-9, out.drive_duty, out.brake_duty, state.omega1_rad_s,
      state.omega2_rad_s, board_->bitten() ? "watchdog has bitten" : "watchdog has not bitten",
      board_->drives_pins() ? "driven" : "pulled high", link_.plugged() ? "in" : "out", board_->writes());
}

const char* EmulatedHm2::commands() {
  return "fault NAME[=NUMBER]             ok loss=PERCENT lose-requests=N lose-answers=N delay=US reorder duplicate\n"
         "                                stale short=BYTES garbage: of the datagrams\n"
         "link up|down                    the Ethernet cable; the rig goes on\n"
         "bite                            the watchdog bites now\n"
         "power-cycle                     the board is switched off and on; the wheels turn on\n"
         "talker read|write|drive|off     another program sends every 10 ms: reads, writes its number, drives the "
         "brake\n"
         "quadrature-error upper|lower    a counter sees both lines change together\n"
         "estop on|off                    the emergency stop: cuts the drive only\n"
         "turn upper|lower REVOLUTIONS    a wheel is turned by hand\n"
         "changes FILE | changes off      each change of the outputs: when, ns of CLOCK_MONOTONIC (in lock-step of "
         "the\n"
         "                                board's time), drive, brake\n"
         "registers                       every register that a host has set\n"
         "status                          duties at the power stages, speeds, watchdog, pins\n";
}

std::string EmulatedHm2::obey(std::string_view line) {
  catch_up();
  const ControlCommand command(line);
  if (command.empty()) return {};
  emulator::UdpBoard& board = *board_;
  const auto first_is = [&command](std::string_view a, std::string_view b) {
    return command.text(1) == a || command.text(1) == b;
  };
  if (command.is("fault", 1)) {
    link_.set(command.text(1));
  } else if (command.is("link", 1) && first_is("up", "down")) {
    link_.plug(command.text(1) == "up");
  } else if (command.is("bite", 0)) {
    board.bite();
  } else if (command.is("power-cycle", 0)) {
    board_->power_cycle();
  } else if (command.is("talker", 1) && (first_is("read", "write") || first_is("drive", "off"))) {
    const std::string& what = command.text(1);
    talker_ = what == "read"    ? Talker::read
              : what == "write" ? Talker::write
              : what == "drive" ? Talker::drive
                                : Talker::off;
  } else if (command.is("quadrature-error", 1) && first_is("upper", "lower")) {
    board.make_quadrature_error(command.text(1) == "upper");
  } else if (command.is("estop", 1)) {
    board.press_emergency_stop(command.on(1));
  } else if (command.is("changes", 1)) {
    changes_.close();
    if (command.text(1) != "off") open_for_writing(changes_, command.text(1));
  } else if (command.is("registers", 0)) {
    return board.registers_text();
  } else if (command.is("turn", 2)) {
    board.turn_by_hand(command.first_of(1, "upper", "lower"), command.number(2));
  } else if (!command.is("status", 0)) {
    command.refuse(commands());
  }
  log_events();
  return status();
}

}  // namespace abs_hil::program
