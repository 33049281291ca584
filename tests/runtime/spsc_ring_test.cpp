// The ring between the cycle and its reader.
#include "runtime/spsc_ring.hpp"

#include <array>
#include <deque>
#include <random>
#include <thread>

#include "catch.hpp"

using abs_hil::runtime::SpscRing;

namespace {
/// Large enough to be torn if a slot were read while it is written.
struct Element {
  std::array<std::uint64_t, 16> words{};
};
Element element(std::uint64_t number) {
  Element e;
  e.words.fill(number);
  return e;
}
}  // namespace

TEST_CASE("capacity is rounded up to a power of two") {
  CHECK(SpscRing<int>(1).capacity() == 2);
  CHECK(SpscRing<int>(5).capacity() == 8);
  CHECK(SpscRing<int>(8).capacity() == 8);
}

TEST_CASE("in one thread the ring behaves as a bounded queue that drops the newest") {
  SpscRing<int> ring(8);
  std::deque<int> model;
  std::uint64_t drops = 0;
  std::mt19937 random(1);
  for (int i = 0; i < 20'000; ++i) {
    if (random() % 2 == 0) {
      const bool fits = model.size() < ring.capacity();
      REQUIRE(ring.push(i) == fits);
      if (fits) model.push_back(i);
      drops += fits ? 0 : 1;
    } else {
      int got = -1;
      REQUIRE(ring.pop(got) == !model.empty());
      if (!model.empty()) {
        REQUIRE(got == model.front());
        model.pop_front();
      }
    }
  }
  CHECK(ring.drops() == drops);
  CHECK(drops > 0);
}

// Also run under ThreadSanitizer (preset tsan).
TEST_CASE("between two threads nothing is torn, lost uncounted or out of order") {
  constexpr std::uint64_t pushes = 100'000;
  SpscRing<Element> ring(16);
  std::atomic<bool> done{false};
  std::jthread producer([&] {
    for (std::uint64_t i = 1; i <= pushes; ++i) {
      static_cast<void>(ring.push(element(i)));
      if (i % 64 == 0) std::this_thread::yield();
    }
    done.store(true, std::memory_order_release);
  });

  std::uint64_t popped = 0, last = 0;
  bool sound = true;
  Element got;
  const auto take_all = [&] {
    while (ring.pop(got)) {
      for (const std::uint64_t word : got.words) sound = sound && word == got.words[0];
      sound = sound && got.words[0] > last;
      last = got.words[0];
      ++popped;
    }
  };
  while (!done.load(std::memory_order_acquire)) take_all();
  take_all();
  CHECK(sound);
  CHECK(popped + ring.drops() == pushes);
  CHECK(popped > 0);
}
