#include "guardian/mail.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <climits>
#include <cstring>
#include <system_error>

namespace abs_hil::guardian {

namespace {

static_assert(sizeof(Order) <= PIPE_BUF, "an order is written whole or not at all");
constexpr std::size_t page_files = 2;

union FileSpace {
  cmsghdr header;
  std::array<char, CMSG_SPACE(sizeof(int) * page_files)> bytes;
};

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
  iovec part{&copy, sizeof copy};
  msghdr packet{};
  packet.msg_iov = &part;
  packet.msg_iovlen = 1;
  FileSpace space{};
  if (pages.run >= 0) {
    const std::array<int, page_files> files{pages.run, pages.guard};
    packet.msg_control = space.bytes.data();
    packet.msg_controllen = CMSG_SPACE(sizeof files);
    cmsghdr* const control = CMSG_FIRSTHDR(&packet);
    control->cmsg_level = SOL_SOCKET;
    control->cmsg_type = SCM_RIGHTS;
    control->cmsg_len = CMSG_LEN(sizeof files);
    std::memcpy(CMSG_DATA(control), files.data(), sizeof files);
  }
  static_cast<void>(::sendmsg(news_out_.get(), &packet, MSG_NOSIGNAL | MSG_DONTWAIT));
}

bool Mail::next(News& news, driver::FileDescriptor& run_page, driver::FileDescriptor& guard_page) noexcept {
  iovec part{&news, sizeof news};
  msghdr packet{};
  packet.msg_iov = &part;
  packet.msg_iovlen = 1;
  FileSpace space{};
  packet.msg_control = space.bytes.data();
  packet.msg_controllen = space.bytes.size();
  if (::recvmsg(news_in_.get(), &packet, MSG_CMSG_CLOEXEC | MSG_DONTWAIT) != static_cast<ssize_t>(sizeof news)) {
    return false;
  }
  const cmsghdr* const control = CMSG_FIRSTHDR(&packet);
  if (control == nullptr || control->cmsg_len != CMSG_LEN(sizeof(int) * page_files)) return true;
  std::array<int, page_files> files{};
  std::memcpy(files.data(), CMSG_DATA(control), sizeof files);
  run_page = driver::FileDescriptor(files[0]);
  guard_page = driver::FileDescriptor(files[1]);
  return true;
}

}  // namespace abs_hil::guardian
