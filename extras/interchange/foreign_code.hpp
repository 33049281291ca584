#pragma once

#include <dlfcn.h>
#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/interchange/controller.h"
#include "rig/formatted_text.hpp"

namespace abs_hil::interchange {

/// What foreign code is told when it is made.
struct ForeignSetup {
  std::filesystem::path file{};
  std::filesystem::path folder{};   ///< of an extracted FMU
  std::filesystem::path mapping{};  ///< TOML file with an FMU's names; empty: none
  double period_s{0.0};
  bool files_unprotected{false};                             ///< a person accepts that its code could change files
  std::vector<std::pair<std::string, double>> parameters{};  ///< keys of `control.` and `model.`
};

/// A controller that this project did not compile: the C interface of abs_hil/interchange/controller.h, whatever stands
/// behind it. Its code may do anything, so `step` is as safe for real time as that code is.
class ForeignCode {
 public:
  ForeignCode() = default;
  ForeignCode(const ForeignCode&) = delete;
  ForeignCode& operator=(const ForeignCode&) = delete;
  virtual ~ForeignCode() = default;

  virtual void reset(const abs_hil_input& input) noexcept = 0;
  /// @param output  holds NaN in every field; after a failure the torque is NaN
  virtual void step(const abs_hil_input& input, abs_hil_output& output) noexcept = 0;
  /// Names of its own signals, at most ABS_HIL_CONTROLLER_SIGNALS.
  [[nodiscard]] const std::vector<std::string>& signals() const noexcept { return signals_; }
  /// Path of the file with its code, if that is another one than it was made from; else empty.
  [[nodiscard]] const std::string& source() const noexcept { return source_; }
  /// Why it gives no outputs any more; empty while it does. Not real-time safe.
  [[nodiscard]] virtual std::string failure() const { return {}; }
  /// After `reset` and `step` were called to warm it up: makes the next `reset` cheap. Not real-time safe.
  virtual void be_fresh() noexcept {}

 protected:
  std::vector<std::string> signals_{};
  std::string source_{};
};

/// Durations of steps, ns.
struct StepTimes {
  std::int64_t steps{0};
  std::int64_t median_ns{0};
  std::int64_t p99_ns{0};
  std::int64_t worst_ns{0};
};

/// What real-time code must not do, found in trial steps.
struct Offences {
  std::uint64_t allocations{0};
  std::uint64_t system_calls{0};
  std::int32_t first_system_call{-1};
};

/// The inputs of a braking from 170 rad/s, step by step, to try code without a rig. Wraps round.
[[nodiscard]] abs_hil_input trial_input(std::int64_t step, double period_s) noexcept;
/// Output whose fields are all NaN.
[[nodiscard]] abs_hil_output no_output() noexcept;
/// Runs the code over trial inputs, so that its memory is present and its caches are warm. Stops at a failure.
[[nodiscard]] StepTimes warm_up(ForeignCode& code, double period_s, std::int64_t steps);

/// Loads a file into this process. Throws std::invalid_argument, which names the file, before anything of a file that
/// cannot fit runs.
[[nodiscard]] std::unique_ptr<ForeignCode> load_here(const ForeignSetup& setup);

/// Loads the library of an extracted FMU (ForeignSetup::folder) and makes an instance. Throws std::invalid_argument.
[[nodiscard]] std::unique_ptr<ForeignCode> load_fmu(const ForeignSetup& setup);

/// Loads the library, checks its functions, the version and the sizes of its interface, and makes a controller. Throws
/// std::invalid_argument, which names the file and the fix.
[[nodiscard]] std::unique_ptr<ForeignCode> load_library(const ForeignSetup& setup);

/// Refuses a file, whose name begins the message. Throws std::invalid_argument.
[[noreturn]] inline void refuse(const std::filesystem::path& file, const std::string& why) {
  throw std::invalid_argument(fmt::format("{}: {}", file.string(), why));
}

/// A shared library in this process, which is the confined one of foreign code first (hosted_code.hpp). Its
/// constructors have run.
class LoadedLibrary {
 public:
  /// Throws std::invalid_argument, which names `file` (the library, or the FMU that it is of) and the loader's reason.
  LoadedLibrary(const std::filesystem::path& library, std::filesystem::path file)
      // With RTLD_NOW a missing function of another library shows here. A name without a slash would be looked for
      // elsewhere.
      : file_(std::move(file)), handle_(::dlopen(std::filesystem::absolute(library).c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (handle_) return;
    const std::string place = std::filesystem::absolute(library).string();
    const std::string why = ::dlerror();
    // The loader says of a library for another processor that there is no such file.
    const bool foreign =
        why.starts_with(place + ": cannot open shared object file: No such file") && std::filesystem::exists(place);
    refuse(file_, "not a shared library that this computer can load: " +
                      (foreign ? place + ": it is for another processor: build it here" : rig::refusal(why, place)));
  }
  /// The function or object of that name. Throws std::invalid_argument if there is none.
  template <class Symbol>
  [[nodiscard]] Symbol* find(const char* name) const {
    auto* const symbol = reinterpret_cast<Symbol*>(::dlsym(handle_.get(), name));
    if (symbol == nullptr) refuse(file_, std::string("it does not define ") + name);
    return symbol;
  }

 private:
  struct Close {
    void operator()(void* handle) const noexcept { ::dlclose(handle); }
  };
  std::filesystem::path file_;
  std::unique_ptr<void, Close> handle_;
};

}  // namespace abs_hil::interchange
