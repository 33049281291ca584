#include "interchange/library_code.hpp"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <string_view>

#include "interchange/elf_library.hpp"
#include "interchange/loaded_library.hpp"
#include "interchange/refused_file.hpp"

namespace abs_hil::interchange {

namespace {

constexpr const char* interface_name = "abs_hil_controller_interface";
constexpr std::array functions{"abs_hil_controller_create", "abs_hil_controller_reset", "abs_hil_controller_step",
                               "abs_hil_controller_signal", "abs_hil_controller_destroy"};
constexpr const char* header_name = "abs_hil/interchange/controller.h";

void check_size(const std::filesystem::path& file, const char* what, std::uint32_t its, std::size_t ours) {
  if (its == ours) return;
  refuse(file, fmt::format("its {} has {} bytes, that of this program has {}; build it with this program's {}", what,
                           its, ours, header_name));
}

class LibraryCode final : public ForeignCode {
 public:
  explicit LibraryCode(const ForeignSetup& setup) : library_(setup.file) {
    library_.find(functions[0], create_);
    library_.find(functions[1], reset_);
    library_.find(functions[2], step_);
    library_.find(functions[3], signal_);
    library_.find(functions[4], destroy_);
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
    refuse(setup.file, fmt::format("{} failed: {}", functions[0], reason.empty() ? "it gives no reason" : reason));
  }

  LoadedLibrary library_;
  decltype(abs_hil_controller_create)* create_{nullptr};
  decltype(abs_hil_controller_reset)* reset_{nullptr};
  decltype(abs_hil_controller_step)* step_{nullptr};
  decltype(abs_hil_controller_signal)* signal_{nullptr};
  decltype(abs_hil_controller_destroy)* destroy_{nullptr};
  void* controller_{nullptr};
};

}  // namespace

void check_library(const std::filesystem::path& file) {
  const ElfLibrary library(file);
  if (!library.has_object(interface_name)) {
    refuse(file,
           fmt::format("not a controller: it has no symbol {}; write ABS_HIL_CONTROLLER_INTERFACE; once in it ({})",
                       interface_name, header_name));
  }
  abs_hil_controller_interface_t its{};
  const auto bytes = library.object(interface_name);
  if (bytes.size() != sizeof its) {
    refuse(file, fmt::format("its {} has {} bytes instead of {}; build it with this program's {}", interface_name,
                             bytes.size(), sizeof its, header_name));
  }
  std::memcpy(&its, bytes.data(), sizeof its);
  if (its.magic != ABS_HIL_CONTROLLER_MAGIC) {
    refuse(file, fmt::format("its {} does not begin as it should; build it with {}", interface_name, header_name));
  }
  if (its.version != ABS_HIL_CONTROLLER_VERSION) {
    refuse(file, fmt::format("it has version {} of the interface, this program has version {}; build it with this "
                             "program's {}",
                             its.version, ABS_HIL_CONTROLLER_VERSION, header_name));
  }
  check_size(file, "abs_hil_setup", its.setup_size, sizeof(abs_hil_setup));
  check_size(file, "abs_hil_input", its.input_size, sizeof(abs_hil_input));
  check_size(file, "abs_hil_output", its.output_size, sizeof(abs_hil_output));
  for (const char* function : functions) {
    if (!library.has_function(function)) refuse(file, fmt::format("it does not define the function {}", function));
  }
}

std::unique_ptr<ForeignCode> load_library(const ForeignSetup& setup) {
  check_library(setup.file);
  return std::make_unique<LibraryCode>(setup);
}

}  // namespace abs_hil::interchange
