// Calls a controller in a shared library through abs_hil/interchange/controller.h.
#include <fmt/format.h>

#include <array>
#include <cstring>
#include <string_view>

#include "interchange/foreign_code.hpp"
#include "interchange/loaded_library.hpp"

namespace abs_hil::interchange {

namespace {

constexpr const char* interface_name = "abs_hil_controller_interface";
constexpr const char* create_name = "abs_hil_controller_create";
constexpr const char* header_name = "abs_hil/interchange/controller.h";

void check_size(const std::filesystem::path& file, const char* what, std::uint32_t its, std::size_t ours) {
  if (its == ours) return;
  refuse(file, fmt::format("its {} has {} bytes, that of this program has {}; build it with this program's {}", what,
                           its, ours, header_name));
}

/// The library, if version and sizes that it states for itself are those of this program.
LoadedLibrary loaded(const std::filesystem::path& file) {
  LoadedLibrary library(file, file);
  const auto* const its = library.find<const abs_hil_controller_interface_t>(interface_name);
  if (its->magic != ABS_HIL_CONTROLLER_MAGIC) {
    refuse(file, fmt::format("its {} does not begin as it should; build it with {}", interface_name, header_name));
  }
  if (its->version != ABS_HIL_CONTROLLER_VERSION) {
    refuse(file, fmt::format("it has version {} of the interface, this program has version {}; build it with this "
                             "program's {}",
                             its->version, ABS_HIL_CONTROLLER_VERSION, header_name));
  }
  check_size(file, "abs_hil_setup", its->setup_size, sizeof(abs_hil_setup));
  check_size(file, "abs_hil_input", its->input_size, sizeof(abs_hil_input));
  check_size(file, "abs_hil_output", its->output_size, sizeof(abs_hil_output));
  return library;
}

class LibraryCode final : public ForeignCode {
 public:
  explicit LibraryCode(const ForeignSetup& setup) : library_(loaded(setup.file)) {
    make(setup);
    for (std::uint32_t n = 0; const char* name = signal_(controller_, n); ++n) {
      if (n == ABS_HIL_CONTROLLER_SIGNALS) {
        destroy_(controller_);
        refuse(setup.file, fmt::format("it has more than {} signals", ABS_HIL_CONTROLLER_SIGNALS));
      }
      signals_.emplace_back(name);
    }
  }
  LibraryCode(const LibraryCode&) = delete;
  LibraryCode& operator=(const LibraryCode&) = delete;
  ~LibraryCode() override { destroy_(controller_); }

  void reset(const abs_hil_input& input) noexcept override { reset_(controller_, &input); }
  void step(const abs_hil_input& input, abs_hil_output& output) noexcept override {
    step_(controller_, &input, &output);
  }

 private:
  void make(const ForeignSetup& setup) {
    std::vector<abs_hil_parameter> parameters;
    for (const auto& [name, value] : setup.parameters) parameters.push_back({name.c_str(), value});
    const abs_hil_setup told{.size = sizeof(abs_hil_setup),
                             .parameter_count = static_cast<std::uint32_t>(parameters.size()),
                             .parameters = parameters.data(),
                             .period_s = setup.period_s};
    std::array<char, 256> error{};
    controller_ = create_(&told, error.data(), error.size());
    if (controller_ != nullptr) return;
    const std::string_view reason(error.data(), ::strnlen(error.data(), error.size()));
    refuse(setup.file, fmt::format("{} failed: {}", create_name, reason.empty() ? "it gives no reason" : reason));
  }

  LoadedLibrary library_;
  decltype(abs_hil_controller_create)* create_{library_.find<decltype(abs_hil_controller_create)>(create_name)};
  decltype(abs_hil_controller_reset)* reset_{
      library_.find<decltype(abs_hil_controller_reset)>("abs_hil_controller_reset")};
  decltype(abs_hil_controller_step)* step_{library_.find<decltype(abs_hil_controller_step)>("abs_hil_controller_step")};
  decltype(abs_hil_controller_signal)* signal_{
      library_.find<decltype(abs_hil_controller_signal)>("abs_hil_controller_signal")};
  decltype(abs_hil_controller_destroy)* destroy_{
      library_.find<decltype(abs_hil_controller_destroy)>("abs_hil_controller_destroy")};
  void* controller_{nullptr};
};

}  // namespace

std::unique_ptr<ForeignCode> load_library(const ForeignSetup& setup) { return std::make_unique<LibraryCode>(setup); }

}  // namespace abs_hil::interchange
