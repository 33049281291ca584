// The doctor's verdict on a backend, from a board that is there or not.
#include "diagnosis/doctor.hpp"

#include <nlohmann/json.hpp>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::diagnosis;

namespace {

Examination only_backend(std::function<std::unique_ptr<driver::RigDriver>()> make_driver) {
  return {.only = "backend", .backend = "rig", .make_driver = std::move(make_driver)};
}

/// A board that is there or not.
class Board final : public driver::RigDriver {
 public:
  explicit Board(bool there) : there_(there) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "board"; }

 private:
  void do_configure() override {
    if (!there_) throw driver::Unavailable("no board in slot 3; plug it in");
  }
  void do_activate(std::int64_t) override { throw std::logic_error("the doctor must not activate"); }
  driver::IoResult do_read(std::int64_t, rig::Measurement&) noexcept override { return {}; }
  driver::IoResult do_write(const rig::Command&, rig::Command&) noexcept override { return {}; }
  driver::IoResult do_make_safe() noexcept override { return {}; }
  bool there_;
};

struct SlotOptions {
  ABS_HIL_OPTIONS(SlotOptions);
  ABS_HIL_OPTION(std::string, slot, "slot 3", .meaning = "the slot of the board");
};

/// A laboratory's own backend, which tells the doctor what leads to its board.
void register_slot() {
  static const bool done = [] {
    driver::register_backend(driver::backend<SlotOptions>(
        {.name = "slot",
         .summary = "a board in a slot",
         .not_verified = "Nobody has seen it",
         .make_driver = [](const SlotOptions&, const driver::RunFacts&) -> std::unique_ptr<driver::RigDriver> {
           return std::make_unique<Board>(true);
         },
         .make_safe_state_writer = [](const SlotOptions&, const driver::RunFacts&)
             -> std::unique_ptr<driver::SafeStateWriter> { return nullptr; },
         .outputs = [](const SlotOptions&) { return driver::OutputGrid{.duty_steps = 100}; },
         .inspect =
             [](const SlotOptions& options, double rate_Hz, bool chosen) {
               return std::vector<Finding>{{.what = options.slot + (chosen ? ", chosen" : ""),
                                            .standing = rate_Hz > 1000.0 ? Standing::warning : Standing::good}};
             }}));
    return true;
  }();
  static_cast<void>(done);
}

}  // namespace

TEST_CASE("a laboratory's own backend has a check of its own, by its row alone") {
  register_slot();
  Examination examination{.only = "slot", .rate_Hz = 2000.0};
  examination.driver.boards.of<SlotOptions>().slot = "slot 5";
  const auto findings = examine(examination);
  REQUIRE(findings.size() == 1);
  CHECK(findings.front().check == "slot");
  CHECK(findings.front().what == "slot 5");
  CHECK(findings.front().standing == Standing::warning);
  CHECK_FALSE(turned_out_well(examination, findings));
  examination.driver.kind = "slot";
  CHECK(examine(examination).front().what == "slot 5, chosen");
}

TEST_CASE("the backend can run if its driver configures; it is not activated") {
  const auto examination = only_backend([] { return std::make_unique<Board>(true); });
  const auto findings = examine(examination);
  CHECK(findings.front().standing == Standing::good);
  CHECK(turned_out_well(examination, findings));
}

TEST_CASE("a backend that cannot run is a failure with the driver's message") {
  const auto examination = only_backend([] { return std::make_unique<Board>(false); });
  const auto findings = examine(examination);
  CHECK(findings.front().standing == Standing::failure);
  CHECK(findings.front().detail == "no board in slot 3; plug it in");
  CHECK_FALSE(turned_out_well(examination, findings));
  const auto none = only_backend([]() -> std::unique_ptr<driver::RigDriver> { throw driver::Unavailable("no kind"); });
  CHECK(worst(examine(none)) == Standing::failure);
}

TEST_CASE("a warning decides the result of its own check, but not the result of all checks") {
  Examination examination{.only = "lcm", .lcm_url = "udpm://10.0.0.1:7667"};  // not a multicast address
  const auto findings = examine(examination);
  REQUIRE(findings.size() == 1);
  CHECK(findings.front().standing == Standing::warning);
  CHECK(findings.front().fix.find("--no-lcm") != std::string::npos);
  CHECK_FALSE(turned_out_well(examination, findings));
  examination.only.clear();
  CHECK(turned_out_well(examination, findings));
}

TEST_CASE("every name of a check selects the findings of that check only") {
  for (const std::string& name : check_names()) {
    Examination examination = only_backend([] { return std::make_unique<Board>(true); });
    examination.only = name;
    examination.lcm_url = "memq://";
    const auto findings = examine(examination);
    CAPTURE(name);
    REQUIRE_FALSE(findings.empty());
    for (const Finding& finding : findings) CHECK(finding.check == name);
    CHECK(to_json(findings).size() == findings.size());
  }
}

TEST_CASE("findings for people have their fix below, each line indented") {
  const std::vector<Finding> findings{
      {.check = "cpu", .what = "thing", .standing = Standing::warning, .detail = "is off", .fix = "do a\ndo b"}};
  CHECK(to_text(findings) == "WARN  thing: is off\n      fix:\n        do a\n        do b\n");
}
