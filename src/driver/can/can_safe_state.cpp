// Makes a CAN node safe from a second process.
#include <utility>

#include "driver/can/can_driver.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"

namespace abs_hil::driver::can {

namespace {

constexpr std::int64_t answer_ns = 100'000'000;
constexpr std::int64_t look_ns = 5'000'000;

class CanSafeState final : public OwnHandleWriter<Link> {
 public:
  CanSafeState(Open open_link, bool one_peer) : OwnHandleWriter(std::move(open_link)), one_peer_(one_peer) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "can"; }
  void prepare() override {
    if (!one_peer_) open_now();
  }
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override { return can_make_safe_bound_ns; }
  void let_go() noexcept override {
    if (one_peer_) handle_ = {};
  }

 private:
  [[nodiscard]] IoResult write_zeros() noexcept override {
    handle_.socket->drain();  // earlier frames must not count as the answer
    IoResult result = send_zeros();
    if (result.ok()) result = verify();
    if (!result.ok() && one_peer_) handle_ = {};
    return result;
  }
  /// One SYNC and its answer, at most 5 ms long. The answer tells that the node is inactive, which keeps its outputs 0;
  /// an answer with applied duties, on classic CAN every tenth, tells these as well. `foreign_writer` if any frame
  /// shows a node that is not inactive, or duties, or is a command.
  [[nodiscard]] IoResult look() noexcept override {
    IoResult seen{IoError::no_answer, id::sync};
    if (!handle_.socket->send(frame_of(id::sync, {.sequence = ++sync_})).ok()) return seen;
    handle_.socket->listen(monotonic_ns() + look_ns, [&](const Frame& frame) {
      const Decoded decoded = decode(frame);
      const Values& told = decoded.values;
      if (commands_node(frame) || told.state() != NodeState::inactive || told.any_duty()) {
        seen = foreign_output(frame.id);
      } else if ((decoded.id == id::latch || decoded.id == id::measurement) && told.sequence == sync_) {
        seen = {};
      }
      return seen.error != IoError::no_answer;
    });
    return seen;
  }
  [[nodiscard]] IoResult send_zeros() noexcept {
    const IoResult requested = handle_.socket->send(control_frame(Request::deactivate));
    // A node that missed the request, or does not obey it, still takes a command of zeros.
    const IoResult zeros = handle_.socket->send(frame_of(id::command, {}));
    for (const IoResult& result : {requested, zeros}) {
      if (result.error == IoError::disconnected) {
        return {IoError::disconnected, id::control, result.errno_value, rig::Reason::can_interface_down};
      }
    }
    return {};
  }
  /// Waits until the node reports the safe state.
  [[nodiscard]] IoResult verify() noexcept {
    bool inactive = false;
    bool zero = false;
    const bool safe = handle_.socket->listen(monotonic_ns() + answer_ns, [&](const Frame& frame) {
      const Decoded decoded = decode(frame);
      if (decoded.id == id::status) inactive = decoded.values.state() == NodeState::inactive;
      if (decoded.id == id::outputs) zero = !decoded.values.any_duty();
      return inactive && zero;
    });
    return safe ? IoResult{} : IoResult{IoError::no_answer, id::control, 0, rig::Reason::can_node_silent};
  }

  bool one_peer_;
  std::uint8_t sync_{0};
};

}  // namespace

std::unique_ptr<SafeStateWriter> safe_state_writer(OpenLink open_link, bool one_peer) {
  return std::make_unique<CanSafeState>(std::move(open_link), one_peer);
}

}  // namespace abs_hil::driver::can
