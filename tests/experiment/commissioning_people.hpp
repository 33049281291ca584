#pragma once

#include <functional>
#include <string>
#include <vector>

#include "catch.hpp"
#include "driver/pci/model_card.hpp"
#include "experiment/commissioning.hpp"

namespace abs_hil::experiment::test {

/// Plays the person: yes to everything but one question, and does something with the rig when asked to.
class Person final : public Dialog {
 public:
  void tell(const std::string& text) override { said += text + '\n'; }
  Answer ask(const std::string& question) override {
    asked.push_back(question);
    before_answer();
    if (static_cast<int>(asked.size()) == leaves_at) return Answer::none;
    return static_cast<int>(asked.size()) == no_to ? Answer::no : Answer::yes;
  }
  bool wait_until_done(const std::string& text, const std::function<bool()>& watch) override {
    take_time();
    const bool upper = text.find("UPPER") != std::string::npos;
    for (int part = 0; part < parts; ++part) {
      turn(upper);
      if (!watch()) return false;
    }
    enter(upper);
    return !gives_up;
  }

  std::string said{};
  std::vector<std::string> asked{};
  int no_to{0};
  int leaves_at{0};  ///< the input ends at that question
  int parts{1};      ///< in which a wheel is turned; the board is watched after each
  bool gives_up{false};
  std::function<void(bool upper)> turn{[](bool) {}};
  std::function<void(bool upper)> enter{[](bool) {}};
  std::function<void()> take_time{[] {}};
  std::function<void()> before_answer{[] {}};
};

/// Writes down what it is told, beside the outputs at that moment.
class Guard final : public PulseGuard {
 public:
  explicit Guard(const abs_hil::test::ModelCard& card) : card_(card) {}
  void take_board() override { ++taken; }
  void begin() override {
    ++begun;
    acting = true;
    CHECK(card_.model.outputs().drive_duty == 0.0);
    if (refuses) throw driver::Unavailable("no guardian");
  }
  [[nodiscard]] bool beat() noexcept override { return ++beats != dies_at; }
  void end(bool safe) noexcept override {
    acting = false;
    ended_safe += safe ? 1 : 0;
  }
  int taken{0};
  int begun{0};
  int beats{0};
  int dies_at{0};
  int ended_safe{0};
  bool acting{false};
  bool refuses{false};

 private:
  const abs_hil::test::ModelCard& card_;
};

}  // namespace abs_hil::experiment::test
