// A guard's report in words.
#include "guardian/mail.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "guardian/linux_process.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

static_assert(sizeof(Order) <= PIPE_BUF, "an order is written whole or not at all");

using rig::formatted;

double ms_between(std::int64_t from_ns, std::int64_t to_ns) { return static_cast<double>(to_ns - from_ns) * 1e-6; }

}  // namespace

Mail::Mail() {
  std::array<int, 2> orders{-1, -1};
  std::array<int, 2> news{-1, -1};
  if (::pipe2(orders.data(), O_CLOEXEC | O_NONBLOCK) != 0 ||
      ::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, news.data()) != 0) {
    throw std::system_error(errno, std::generic_category(), "guardian: no mailbox");
  }
  orders_in_ = driver::FileDescriptor(orders[0]);
  orders_out_ = driver::FileDescriptor(orders[1]);
  news_in_ = driver::FileDescriptor(news[0]);
  news_out_ = driver::FileDescriptor(news[1]);
}

bool Mail::order(const Order& order) noexcept {
  return ::write(orders_out_.get(), &order, sizeof order) == static_cast<ssize_t>(sizeof order);
}

bool Mail::next(Order& order) noexcept {
  return ::read(orders_in_.get(), &order, sizeof order) == static_cast<ssize_t>(sizeof order);
}

void Mail::tell(const News& news, const Pages::Descriptors& pages) noexcept {
  News copy = news;
  const iovec whole{&copy, sizeof copy};
  const std::array<int, 2> files{pages.run, pages.guard};
  static_cast<void>(send_packet(news_out_.get(), {&whole, 1}, {files.data(), pages.run < 0 ? 0 : files.size()}));
}

bool Mail::next(News& news, std::vector<driver::FileDescriptor>& pages) {
  iovec whole{&news, sizeof news};
  return receive_packet(news_in_.get(), {&whole, 1}, pages) == static_cast<ssize_t>(sizeof news);
}

std::string to_text(const GuardianReport& report, int controller) {
  std::string text(rig::description(report.reason));
  text += formatted(" (reason %d, process %d)", static_cast<int>(report.reason), controller);
  if (report.reason == rig::Reason::controller_silent) {
    text += formatted(": no cycle for %.1f ms; the guardian ended it with SIGKILL before it wrote the safe state",
                      static_cast<double>(report.silence_ns) * 1e-6);
  }
  if (report.reason == rig::Reason::safe_state_unverified && report.ended_controller) {
    text += ": the outputs did not read back as zero after it had given them back; the guardian ended it with SIGKILL";
  } else if (report.reason != rig::Reason::controller_silent && report.ended_controller) {
    text += ": the controller did not give the outputs back in time; the guardian ended it with SIGKILL";
  }
  text += '\n';
  if (!report.acted) return text + "the controller had already made the outputs safe: the guardian wrote nothing\n";
  if (report.controller_gone_ns != 0) {
    text += formatted("the controller's process had ended %.3f ms after the guardian noticed\n",
                      ms_between(report.noticed_ns, report.controller_gone_ns));
  } else if (!report.controller_lives) {
    text += "THE CONTROLLER'S PROCESS DID NOT END: it hangs in the kernel\n";
  }
  if (report.verified) {
    text += formatted("drive 0 and brake 0 written and read back %.3f ms after the guardian noticed, at try %d\n",
                      ms_between(report.noticed_ns, report.verified_ns), report.tries);
    return text;
  }
  text += formatted("SAFE STATE NOT VERIFIED after %d tries%s: ", report.tries,
                    report.released ? ", then released by a person" : "");
  text += driver::error_text(report.last_error);
  text += "\nthe board may hold its last duties: press the E-stop (it cuts the drive only) and switch the rig off\n";
  return text;
}

}  // namespace abs_hil::guardian
