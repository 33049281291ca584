// The cable of the emulated 7I92T: which datagrams come through, when, and in which order.

#include "catch.hpp"
#include "emulator/udp_board.hpp"

using namespace abs_hil::emulator;
using Catch::Matchers::Contains;

namespace {

/// The first bytes of the answers that arrive after `sent` answers 1, 2, 3 ..., one at a time.
std::vector<int> arriving(Hm2Link& link, int sent) {
  std::vector<int> arrived;
  for (int n = 1; n <= sent; ++n) {
    link.send({{static_cast<std::uint8_t>(n), 0xAA}, 7}, 0);
    for (const Hm2Datagram& datagram : link.take_due(0)) {
      CHECK(datagram.peer == 7);
      arrived.push_back(datagram.bytes.empty() ? -1 : datagram.bytes[0]);
    }
  }
  return arrived;
}

using List = std::vector<int>;

}  // namespace

TEST_CASE("Answers arrive as they were sent, twice, in exchanged pairs, or one late") {
  Hm2Link link(1);
  CHECK(arriving(link, 3) == List{1, 2, 3});
  link.set("duplicate");
  CHECK(arriving(link, 2) == List{1, 1, 2, 2});
  link.set("reorder");
  CHECK(arriving(link, 5) == List{2, 1, 4, 3});
  link.set("stale");
  CHECK(arriving(link, 4) == List{1, 1, 2, 3});
  link.set("ok");
  CHECK(arriving(link, 2) == List{1, 2});
}

TEST_CASE("Lost ones are counted down; a share is lost in both directions; short and random answers") {
  Hm2Link link(1);
  link.set("lose-answers=2");
  CHECK(link.request_arrives());
  CHECK(arriving(link, 4) == List{3, 4});
  link.set("lose-requests=2");
  CHECK_FALSE(link.request_arrives());
  CHECK_FALSE(link.request_arrives());
  CHECK(link.request_arrives());
  CHECK(arriving(link, 2) == List{1, 2});
  link.set("loss=25");
  int arrived = 0;
  constexpr int all = 20'000;
  for (int n = 0; n < all; ++n) arrived += link.request_arrives() ? 1 : 0;
  CHECK(std::abs(arrived - all * 3 / 4) < 5 * 62);  // five standard deviations
  link.set("loss=100");
  CHECK(arriving(link, 3).empty());
  link.set("short=0");
  CHECK(arriving(link, 1) == List{-1});
  link.set("garbage");
  const List random = arriving(link, 64);
  CHECK(random.size() == 64);
  CHECK(random != List{1});
}

TEST_CASE("Delayed answers are due later; a pulled cable loses what is under way") {
  Hm2Link link(1);
  link.set("delay=300");
  link.send({{1}, 7}, 1000);
  CHECK(link.take_due(300'999).empty());
  CHECK(link.next_due_ns() == 301'000);
  CHECK(link.take_due(301'000).size() == 1);
  CHECK_FALSE(link.next_due_ns());
  link.send({{2}, 7}, 0);
  link.plug(false);
  CHECK_FALSE(link.request_arrives());
  link.send({{3}, 7}, 0);
  CHECK(link.take_due(1'000'000'000).empty());
  link.plug(true);
  CHECK(link.request_arrives());
}

TEST_CASE("Unknown faults and numbers are refused with the known ones") {
  Hm2Link link(1);
  for (const char* text : {"lost", "loss", "loss=101", "loss=-1", "loss=x", "reorder=2", "delay=", "short=1473"}) {
    CHECK_THROWS_WITH(link.set(text), Contains(text) && Contains("loss=PERCENT"));
  }
}
