// Every interleaving of a ring of two elements, with every value that its loads may return.

#include <memory>
#include <vector>

#include "catch.hpp"
#include "memory_model.hpp"
#include "runtime/spsc_ring.hpp"

using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

namespace {

using Ring = SpscRing<int, ModelledMemory>;

/// One execution: a number of pushes of 1, 2, 3, ... against a number of pops.
struct Traffic {
  Traffic(int pushes, int pops) : push_count(pushes), pop_count(pops) {}
  void push_all() {
    for (int i = 1; i <= push_count; ++i) {
      if (ring.push(i)) accepted.push_back(i);
    }
  }
  void pop_all() {
    for (int i = 0; i < pop_count; ++i) {
      int value = 0;
      if (ring.pop(value)) popped.push_back(value);
    }
  }
  /// Each pushed element came out in order, is still in the ring, or was counted as dropped.
  bool sound() {
    for (int value = 0; ring.pop(value);) popped.push_back(value);
    return popped == accepted && ring.drops() + accepted.size() == static_cast<std::size_t>(push_count);
  }

  Ring ring{2};
  int push_count, pop_count;
  std::vector<int> accepted{}, popped{};
};

Explorer::Verdict play_all(int pushes, int pops, Explorer::Weakened weakened = Explorer::Weakened::nothing) {
  Explorer explorer(weakened);
  return explorer.explore([=]() -> Explorer::Play {
    const auto traffic = std::make_shared<Traffic>(pushes, pops);
    return {{[traffic] { traffic->push_all(); }, [traffic] { traffic->pop_all(); }},
            [traffic] { return traffic->sound(); }};
  });
}

}  // namespace

TEST_CASE("no interleaving loses, repeats, reorders or tears an element") {
  for (const auto& [pushes, pops] : {std::pair{2, 2}, std::pair{3, 2}, std::pair{4, 3}}) {
    const Explorer::Verdict verdict = play_all(pushes, pops);
    CAPTURE(pushes, pops, verdict.executions);
    CHECK(verdict.races == 0);
    CHECK(verdict.unsound == 0);
    CHECK(verdict.executions > 10);
  }
}

TEST_CASE("the model finds the race when publishing is weakened") {
  CHECK(play_all(3, 2, Explorer::Weakened::release_to_relaxed).races > 0);
}

TEST_CASE("the model finds the race when looking is weakened") {
  CHECK(play_all(3, 2, Explorer::Weakened::acquire_to_relaxed).races > 0);
}
