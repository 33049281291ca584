#include "driver/take_over_writer.hpp"

#include <string>
#include <vector>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;

namespace {

struct Board {
  std::vector<std::string> story{};
  bool owned{false};       ///< by somebody else
  IoResult safe_result{};  ///< what verifying the safe state gives
};

class OneOwnerDriver final : public RigDriver {
 public:
  explicit OneOwnerDriver(Board& board) : board_(board) {}
  ~OneOwnerDriver() override { static_cast<void>(deactivate()); }
  [[nodiscard]] std::string_view name() const noexcept override { return "one owner"; }

 private:
  void do_configure() override {
    board_.story.emplace_back("open");
    if (board_.owned) throw Unavailable("owned");
  }
  void do_activate(std::int64_t) override { board_.story.emplace_back("take over"); }
  IoResult do_read(std::int64_t, rig::Measurement&) noexcept override { return {}; }
  IoResult do_write(const rig::Command&, rig::Command&) noexcept override { return {}; }
  IoResult do_make_safe() noexcept override {
    board_.story.emplace_back("safe");
    return board_.safe_result;
  }
  Board& board_;
};

TakeOverWriter writer_of(Board& board) {
  return TakeOverWriter([&board] { return std::make_unique<OneOwnerDriver>(board); });
}

}  // namespace

TEST_CASE("a board with one owner is taken over only after the owner's end, then released") {
  Board board;
  TakeOverWriter writer = writer_of(board);
  writer.prepare();
  CHECK(board.story.empty());
  board.owned = true;
  CHECK(writer.make_safe().error == IoError::disconnected);
  CHECK(writer.make_safe().error == IoError::disconnected);
  board.owned = false;
  board.story.clear();
  CHECK(writer.make_safe().ok());
  CHECK(board.story == std::vector<std::string>{"open", "take over", "safe"});
}

TEST_CASE("a board that does not verify the safe state does not count as safe") {
  Board board;
  TakeOverWriter writer = writer_of(board);
  writer.prepare();
  board.safe_result = {IoError::no_answer, 0x90};
  CHECK(writer.make_safe().error == IoError::no_answer);
  board.safe_result = {};
  CHECK(writer.make_safe().ok());
}
