// The registry of backends: what an entry must have, and that a new entry is all that a new board needs.

#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "catch.hpp"
#include "driver/factory.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using Catch::Matchers::Contains;

namespace {

struct ShelfOptions {
  ABS_HIL_OPTIONS(ShelfOptions);
  ABS_HIL_OPTION(std::string, port, "/dev/shelf", .meaning = "where it is");
  ABS_HIL_OPTION(double, brake_duty_max, 0.4, .meaning = "its cap", .range = rig::positive(1));
};

std::vector<std::string> calls;

std::unique_ptr<RigDriver> make_shelf(const ShelfOptions& options, const RunFacts& run) {
  calls.push_back(options.port + (run.lock_step ? " lock-step" : ""));
  throw Unavailable("shelf: empty");
}
/// Takes the board over with a driver of its own.
class ShelfWriter final : public SafeStateWriter {
 public:
  ShelfWriter(ShelfOptions options, const RunFacts& run) : options_(std::move(options)), run_(run) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "shelf"; }
  void prepare() override { static_cast<void>(make_shelf(options_, run_)); }
  [[nodiscard]] IoResult make_safe() noexcept override { return {IoError::disconnected}; }

 private:
  ShelfOptions options_;
  RunFacts run_;
};
std::unique_ptr<SafeStateWriter> make_writer(const ShelfOptions& options, const RunFacts& run) {
  return std::make_unique<ShelfWriter>(options, run);
}
OutputGrid outputs(const ShelfOptions& options) {
  return {.duty_steps = 100, .brake_duty_max = options.brake_duty_max};
}

const BackendRow<ShelfOptions> shelf{.name = "shelf",
                                     .summary = "a board on a shelf",
                                     .not_verified = "Nobody has seen it",
                                     .make_driver = make_shelf,
                                     .make_safe_state_writer = make_writer,
                                     .outputs = outputs};

/// A test program registers it once.
void register_shelf() {
  static const bool done = (register_backend(backend(shelf)), true);
  static_cast<void>(done);
}

std::vector<std::string> names_of(DriverOptions& options) {
  std::vector<std::string> names;
  rig::for_each_option(options, "driver.",
                       [&](const std::string& name, const rig::OptionFacts&, const auto&) { names.push_back(name); });
  return names;
}

}  // namespace

TEST_CASE("An entry brings its name, its keys, its driver, its writer and its caps") {
  register_shelf();
  DriverOptions options{.kind = "shelf"};
  const std::vector<std::string> names = names_of(options);
  CHECK(std::ranges::count(names, "driver.shelf.port") == 1);
  CHECK(std::ranges::count(names, "driver.shelf.brake_duty_max") == 1);
  CHECK(std::ranges::count(names, "driver.pci.root") == 1);
  bool listed = false;
  for (std::size_t i = 0; !board_name(i).empty(); ++i) listed = listed || board_name(i) == "shelf";
  CHECK(listed);

  calls.clear();
  options.boards.of<ShelfOptions>().port = "/dev/here";
  CHECK_THROWS_AS(make_rig_driver(options, true), Unavailable);
  CHECK(calls == std::vector<std::string>{"/dev/here lock-step"});
  CHECK(make_safe_state_writer(options)->name() == "shelf");
  CHECK(output_grid(options).brake_duty_max == 0.4);
  CHECK(verification_note(options) ==
        "backend rig, driver.kind=shelf: not verified on hardware. Nobody has seen it, then set "
        "driver.verified_on_hardware=true");
  CHECK(reality_of(options).reality == Reality::unknown);
}

TEST_CASE("A copy of the options is a copy of every board's options") {
  register_shelf();
  DriverOptions options{.kind = "shelf"};
  DriverOptions copy = options;
  copy.boards.of<ShelfOptions>().brake_duty_max = 0.1;
  CHECK(options.boards.of<ShelfOptions>().brake_duty_max == 0.4);
  options = copy;
  CHECK(options.boards.of<ShelfOptions>().brake_duty_max == 0.1);
  rig::for_each_option(copy, "driver.", [](const std::string& name, const rig::OptionFacts&, auto& value) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, double>) {
      if (name == "driver.shelf.brake_duty_max") value = 0.2;
    }
  });
  CHECK(copy.boards.of<ShelfOptions>().brake_duty_max == 0.2);
}

TEST_CASE("A board that nothing could make safe has no entry") {
  BackendRow<ShelfOptions> row = shelf;
  row.make_safe_state_writer = nullptr;
  CHECK_THROWS_WITH(backend(row), Contains("'shelf'") && Contains("safe-state writer"));
  row = shelf;
  row.make_driver = nullptr;
  CHECK_THROWS_WITH(backend(row), Contains("makes its driver"));
  row = shelf;
  row.outputs = nullptr;
  CHECK_THROWS_WITH(backend(row), Contains("outputs"));
  row = shelf;
  row.name = "";
  CHECK_THROWS_WITH(backend(row), Contains("needs a name"));
}

TEST_CASE("A name is given once, and sim is no board") {
  register_shelf();
  CHECK_THROWS_AS(register_backend(backend(shelf)), std::invalid_argument);
  BackendRow<ShelfOptions> row = shelf;
  row.name = "sim";
  CHECK_THROWS_AS(register_backend(backend(row)), std::invalid_argument);
}

TEST_CASE("An unknown kind of board is refused by driver, guardian and policy") {
  const DriverOptions options{.kind = "unheard-of"};
  CHECK_FALSE(is_known("unheard-of"));
  CHECK_THROWS_WITH(make_rig_driver(options), Contains("\"unheard-of\"") && Contains("pci, can, usb"));
  CHECK_THROWS_AS(make_safe_state_writer(options), Unavailable);
  CHECK_THROWS_AS(output_grid(options), Unavailable);
  CHECK_THROWS_AS(verification_note(options), Unavailable);
}
