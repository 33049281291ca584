// Which CAN frames belong to the answer, and how many losses are tolerated.
#include "catch.hpp"
#include "driver/board_kit.hpp"
#include "driver/can/can_driver.hpp"

using namespace abs_hil::driver::can;

namespace {

Anomaly take_encoders(AnswerTracker& tracker, unsigned sequence) {
  return tracker.take(id::encoders, {.upper_counts = 1, .lower_counts = 2, .sequence = sequence % 256});
}
Anomaly take_latch(AnswerTracker& tracker, unsigned sequence) {
  return tracker.take(id::latch, {.node_state = 1, .node_time_us = 3, .sequence = sequence % 256});
}

}  // namespace

TEST_CASE("An answer is complete with both its frames, and sequences wrap") {
  AnswerTracker tracker;
  tracker.reset(253);
  for (unsigned cycle = 254; cycle < 600; ++cycle) {
    tracker.expect(static_cast<std::uint8_t>(cycle));
    CHECK_FALSE(tracker.complete());
    CHECK(take_encoders(tracker, cycle) == Anomaly::none);
    CHECK_FALSE(tracker.complete());
    CHECK(take_latch(tracker, cycle) == Anomaly::none);
    REQUIRE(tracker.complete());
    CHECK(tracker.last_sequence() == static_cast<std::uint8_t>(cycle));
    CHECK(tracker.answer().values.upper_counts == 1);
    CHECK(tracker.answer().count_bits == 24);
    CHECK(tracker.answer().values.node_time_us == 3);
  }
}

TEST_CASE("The tracker tells apart the kinds of frames that do not belong to the answer") {
  AnswerTracker tracker;
  tracker.reset(9);
  tracker.expect(10);
  CHECK(take_encoders(tracker, 10) == Anomaly::none);
  CHECK(take_encoders(tracker, 10) == Anomaly::duplicate);
  CHECK(take_latch(tracker, 11) == Anomaly::out_of_order);
  CHECK(take_latch(tracker, 9) == Anomaly::stale);  // 9 was never answered
  CHECK_FALSE(tracker.complete());
  CHECK(take_latch(tracker, 10) == Anomaly::none);
  CHECK(take_latch(tracker, 10) == Anomaly::duplicate);

  tracker.expect(11);
  CHECK(take_encoders(tracker, 10) == Anomaly::duplicate);  // 10 was answered already
  CHECK(take_encoders(tracker, 8) == Anomaly::stale);
  CHECK(take_latch(tracker, 11) == Anomaly::none);
  CHECK(take_encoders(tracker, 11) == Anomaly::out_of_order);  // the latch comes last
  CHECK(tracker.complete());

  tracker.expect(12);  // lost
  tracker.expect(13);
  CHECK(take_latch(tracker, 12) == Anomaly::stale);
  CHECK(tracker.take(id::measurement, {.sequence = 13}) == Anomaly::none);
  CHECK(tracker.complete());
  CHECK(tracker.answer().count_bits == 32);
  CHECK(tracker.take(id::measurement, {.sequence = 13}) == Anomaly::duplicate);
}

TEST_CASE("The bucket tolerates single losses, trips at sustained loss, and latches") {
  abs_hil::driver::LossBucket bucket(2, 1, 10);
  for (int i = 0; i < 100; ++i) {  // one loss in three cycles: what flows in flows out
    bucket.lost();
    bucket.good();
    bucket.good();
  }
  CHECK_FALSE(bucket.tripped());
  int losses = 0;
  while (!bucket.tripped()) {
    bucket.lost();
    ++losses;
  }
  CHECK(losses == 5);
  for (int i = 0; i < 100; ++i) bucket.good();
  CHECK(bucket.tripped());
  bucket.reset();
  CHECK_FALSE(bucket.tripped());
  for (int i = 0; i < 8; ++i) {  // every other cycle lost: +1 each pair, the ninth loss reaches 8 + 2
    bucket.lost();
    bucket.good();
  }
  CHECK_FALSE(bucket.tripped());
  bucket.lost();
  CHECK(bucket.tripped());
}
