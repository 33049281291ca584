// Calling a function for many indices from several threads.
#include "run/parallel.hpp"

#include <atomic>
#include <stdexcept>
#include <vector>

#include "catch.hpp"

using namespace abs_hil;

TEST_CASE("each index is called once, with any number of threads") {
  for (const std::size_t threads : {0U, 1U, 2U, 7U, 64U}) {
    std::vector<std::atomic<int>> calls(50);
    run::for_each_index(calls.size(), threads, [&](std::size_t i) { ++calls[i]; });
    for (const auto& count : calls) CHECK(count == 1);
  }
  run::for_each_index(0, 4, [](std::size_t) { FAIL("there is nothing to call it for"); });
}

TEST_CASE("an exception ends the series and reaches the caller") {
  std::atomic<int> calls{0};
  const auto task = [&](std::size_t i) {
    ++calls;
    if (i == 3) throw std::runtime_error("third");
  };
  CHECK_THROWS_WITH(run::for_each_index(1'000'000, 1, task), "third");
  CHECK(calls == 4);
  CHECK_THROWS_WITH(run::for_each_index(1'000'000, 4, task), "third");
}
