#pragma once

#include "experiment/sequence.hpp"

namespace abs_hil::experiment::test {

/// A sequence with the latch that the gate of its run is.
class LatchedSequence : public Sequence {
 public:
  using Sequence::Sequence;
  Change update(const SequenceInput& input) noexcept { return Sequence::update(input, latch); }

  runtime::RunLatch latch{};
};

}  // namespace abs_hil::experiment::test
