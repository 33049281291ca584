// The emulated 7I92T, or the node, behind a UDP socket with a cable that can be pulled.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "control.hpp"
#include "emulator/udp_board.hpp"
#include "rig/formatted_text.hpp"

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

struct Talker {
  std::string_view name;
  std::span<const std::uint8_t> says;
};
constexpr std::array<Talker, 4> talkers{
    {{"off", {}}, {"read", reads_the_clock}, {"write", writes_its_number}, {"drive", drives_the_brake}}};

/// "ADDRESS" or "ADDRESS:PORT".
sockaddr_in address_in(const std::string& text) {
  const auto refuse = [&text](const std::string& why) {
    throw std::invalid_argument("address \"" + text + "\": " + why + "; give ADDRESS or ADDRESS:PORT, for example " +
                                "127.0.0.1:27181");
  };
  const std::size_t colon = text.find(':');
  sockaddr_in address{};
  address.sin_family = AF_INET;
  if (::inet_pton(AF_INET, text.substr(0, colon).c_str(), &address.sin_addr) != 1) refuse("not an IPv4 address");
  const auto port = colon == std::string::npos ? emulator::hm2_port
                                               : rig::parse_number<std::uint16_t>(text.substr(colon + 1)).value_or(0);
  if (port == 0) refuse("the port is not 1 to 65535");
  address.sin_port = htons(port);
  return address;
}

std::array<std::uint8_t, 6> mac_in(const std::string& text) {
  std::array<std::uint8_t, 6> m{};
  int used = 0;
  if (std::sscanf(text.c_str(), "%2hhx:%2hhx:%2hhx:%2hhx:%2hhx:%2hhx%n", &m[0], &m[1], &m[2], &m[3], &m[4], &m[5],
                  &used) != 6 ||
      used != static_cast<int>(text.size())) {
    throw std::invalid_argument("--mac " + text + ": give six bytes, for example 00:60:1b:16:ab:50");
  }
  return m;
}

bool is_node(const EmulatorOptions& options) { return !options.node_address.empty(); }

emulator::BoardOptions board_options(const EmulatorOptions& options, const sockaddr_in& address) {
  emulator::BoardOptions board = options.board;
  if (board.name.empty()) board.name = is_node(options) ? "abs-node" : "7I92T";
  std::memcpy(board.address.data(), &address.sin_addr, board.address.size());
  if (!options.mac.empty()) board.mac = mac_in(options.mac);
  if (is_node(options) && board.enable_line > 0)
    throw std::invalid_argument("--enable-line: the node has output 0 alone");
  for (const std::string& text : options.wrong_words) {
    unsigned place = 0, value = 0;
    int used = 0;
    if (std::sscanf(text.c_str(), "%x=%x%n", &place, &value, &used) != 2 || used != static_cast<int>(text.size()) ||
        place < 0x100 || place > 0x7FC || place % 4 != 0) {
      throw std::invalid_argument("--wrong-board " + text + ": give a word from 0x100 to 0x7fc and its value");
    }
    board.words.emplace_back(static_cast<std::uint16_t>(place), value);
  }
  if (is_node(options) && (!board.words.empty() || board.active_high_stage)) {
    throw std::invalid_argument("--wrong-board and --active-high are of the 7I92T, not of the node; give --hm2");
  }
  return board;
}

/// The 7I92T or the node behind a UDP socket: time, cable, logs and the control commands.
class EmulatedHm2 final : public BoardOf<EmulatedHm2> {
 public:
  explicit EmulatedHm2(const EmulatorOptions& options)
      : BoardOf(options),
        is_node_(is_node(options)),
        address_text_(is_node_ ? options.node_address : options.hm2_address),
        address_(address_in(address_text_)),
        options_(board_options(options, address_)),
        board_(is_node_ ? emulator::node_board(options_) : emulator::hm2_board(options_)),
        link_(options.seed) {
    if (socket_.get() < 0 ||
        ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address_), sizeof address_) != 0) {
      throw std::runtime_error(address_text_ + ": " + rig::refusal(errno, address_text_, rig::reaching));
    }
  }

  [[nodiscard]] int descriptor() const override { return socket_.get(); }
  bool serve() override {
    std::array<std::uint8_t, 2048> buffer{};
    for (;;) {
      sockaddr_in from{};
      socklen_t length = sizeof from;
      const ssize_t got =
          ::recvfrom(socket_.get(), buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
      if (got < 0) break;
      if (!link_.request_arrives()) continue;
      time_.catch_up(*board_);
      emulator::Hm2Datagram answer{board_->answer(std::span(buffer).first(static_cast<std::size_t>(got))),
                                   std::uint64_t{from.sin_addr.s_addr} << 16U | from.sin_port};
      if (!answer.bytes.empty()) link_.send(std::move(answer), driver::monotonic_ns());
      send_due();
    }
    log_events();
    return true;
  }
  void catch_up() override {
    time_.catch_up(*board_);
    talk();
    send_due();
    log_events();
  }
  [[nodiscard]] std::optional<std::int64_t> next_due_ns() const override {
    const std::optional<std::int64_t> due = link_.next_due_ns();
    return due ? std::optional(*due - driver::monotonic_ns()) : std::nullopt;
  }
  [[nodiscard]] std::string status() const override {
    constexpr int microseconds = 6;
    return fmt::format("{}, {}, pins {}, cable {}, writes {}", state_text(*board_, microseconds),
                       board_->bitten() ? "watchdog has bitten" : "watchdog has not bitten",
                       board_->drives_pins() ? "driven"
                       : is_node_            ? "pulled low"
                                             : "pulled high",
                       link_.plugged() ? "in" : "out", board_->writes());
  }
  [[nodiscard]] std::string place() const override {
    return fmt::format("{} at {}:{}", options_.name, address_text_.substr(0, address_text_.find(':')),
                       ntohs(address_.sin_port));
  }
  [[nodiscard]] static std::span<const ControlRow<EmulatedHm2>> rows() {
    using Hm2 = EmulatedHm2;
    using Command = ControlCommand;
    static constexpr std::array<ControlRow<Hm2>, 10> all{{
        {"fault NAME[=NUMBER]",
         "ok loss=PERCENT lose-requests=N lose-answers=N delay=US reorder duplicate stale short=BYTES garbage: of the "
         "datagrams",
         [](Hm2& hm2, const Command& c) { hm2.link_.set(c.text(1)); }},
        {"link up|down", "the Ethernet cable; the rig goes on",
         [](Hm2& hm2, const Command& c) { hm2.link_.plug(c.first_of(1, "up", "down")); }},
        {"bite", "the watchdog bites now", [](Hm2& hm2, const Command&) { hm2.board_->bite(); }},
        {"power-cycle", "the board is switched off and on; the wheels turn on",
         [](Hm2& hm2, const Command&) { hm2.board_->power_cycle(); }},
        {"talker read|write|drive|off", "another program sends every 10 ms: reads, writes its number, drives the brake",
         [](Hm2& hm2, const Command& c) { hm2.set_talker(c.text(1)); }},
        {"quadrature-error upper|lower", "a counter sees both lines change together",
         [](Hm2& hm2, const Command& c) { hm2.board_->make_quadrature_error(c.first_of(1, "upper", "lower")); }},
        estop_row<Hm2>,
        turn_row<Hm2>,
        {"changes FILE|off",
         "each change of the outputs: when, ns of CLOCK_MONOTONIC (in lock-step of the board's time), drive, brake",
         [](Hm2& hm2, const Command& c) { hm2.changes_.begin(c.text(1)); }},
        {.usage = "registers", .meaning = "every register that a host has set", .answer = &Hm2::registers},
    }};
    return all;
  }
  [[nodiscard]] emulator::UdpBoard& model() noexcept { return *board_; }

 private:
  void send_due() {
    for (const emulator::Hm2Datagram& answer : link_.take_due(driver::monotonic_ns())) {
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_port = static_cast<std::uint16_t>(answer.peer);
      to.sin_addr.s_addr = static_cast<std::uint32_t>(answer.peer >> 16U);
      static_cast<void>(::sendto(socket_.get(), answer.bytes.data(), answer.bytes.size(), MSG_NOSIGNAL,
                                 reinterpret_cast<const sockaddr*>(&to), sizeof to));
    }
  }
  void talk() {
    if (talker_.empty() || board_->time_ns() < talks_ns_) return;
    talks_ns_ = board_->time_ns() + talks_every_ns;
    static_cast<void>(board_->answer(talker_));
  }
  void set_talker(const std::string& what) {
    const auto found = std::ranges::find(talkers, what, &Talker::name);
    if (found == talkers.end()) throw std::invalid_argument("\"" + what + "\": give read, write, drive or off");
    talker_ = found->says;
  }
  [[nodiscard]] std::string registers() const { return board_->registers_text(); }

  bool is_node_;
  std::string address_text_;
  sockaddr_in address_;
  emulator::BoardOptions options_;
  std::unique_ptr<emulator::UdpBoard> board_;
  emulator::Hm2Link link_;
  driver::FileDescriptor socket_{::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
  std::span<const std::uint8_t> talker_{};
  std::int64_t talks_ns_{0};
};

}  // namespace

BoardKind hm2_kind() { return kind_of<EmulatedHm2>("a 7I92T or a node"); }

}  // namespace abs_hil::program
