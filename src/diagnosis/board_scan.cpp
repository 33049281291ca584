#include "diagnosis/board_scan.hpp"

#include <string>

namespace abs_hil::diagnosis {

namespace {

Finding judge_board(const driver::FoundBoard& board) {
  Finding f{.check = "boards", .what = board.what, .detail = board.detail};
  for (const driver::FoundBoard::Obstacle& obstacle : board.obstacles) {
    f.standing = Standing::warning;
    f.detail += (f.detail.empty() ? "" : "; ") + obstacle.what;
    f.fix += (f.fix.empty() ? "" : "\n") + obstacle.fix;
  }
  return f;
}

}  // namespace

std::vector<Finding> judge(std::string_view kind, const std::vector<driver::FoundBoard>& boards) {
  if (boards.empty()) {
    return {{.check = "boards",
             .what = "no board of driver.kind=" + std::string(kind) + " found",
             .standing = Standing::note,
             .detail = "searched by driver." + std::string(kind) + ".* (abs_hil list --keys)"}};
  }
  std::vector<Finding> findings;
  findings.reserve(boards.size());
  for (const driver::FoundBoard& board : boards) findings.push_back(judge_board(board));
  return findings;
}

}  // namespace abs_hil::diagnosis
