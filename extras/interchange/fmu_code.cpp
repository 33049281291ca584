// Calls a controller FMU through FMI 2 or 3.
#include <fmi/fmi2FunctionTypes.h>
#include <fmi/fmi3FunctionTypes.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <type_traits>
#include <vector>

#include "interchange/file_uri.hpp"
#include "interchange/fmu_facts.hpp"
#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

namespace {

void put_field(void* record, std::size_t offset, double value) {
  std::memcpy(static_cast<char*>(record) + offset, &value, sizeof value);
}
double field_of(const void* record, std::size_t offset) {
  double value = 0.0;
  std::memcpy(&value, static_cast<const char*>(record) + offset, sizeof value);
  return value;
}

void say(const char* instance, const char* message) {
  static_cast<void>(std::fprintf(stderr, "%s: %s\n", instance, message));
}

// NOLINTNEXTLINE(cert-dcl50-cpp): the standard's type
void log2(fmi2ComponentEnvironment /*environment*/, fmi2String instance, fmi2Status status, fmi2String /*category*/,
          fmi2String format, ...) {
  if (status < fmi2Error) return;
  std::array<char, 1024> text{};
  va_list arguments;
  va_start(arguments, format);
  static_cast<void>(std::vsnprintf(text.data(), text.size(), format, arguments));
  va_end(arguments);
  say(instance, text.data());
}
void log3(fmi3InstanceEnvironment /*environment*/, fmi3Status status, fmi3String /*category*/, fmi3String message) {
  if (status >= fmi3Error) say("controller", message);
}

/// A call of a function of the FMU, and the status that it returned.
struct Called {
  const char* function{""};
  unsigned status{0};
  [[nodiscard]] bool worked() const { return status <= fmi2Warning; }
  [[nodiscard]] std::string text() const {
    constexpr std::array names{"OK", "Warning", "Discard", "Error", "Fatal", "Pending"};
    if (status == wants_the_end) return fmt::format("its {} asked to end the simulation", function);
    if (status >= names.size()) return fmt::format("its {} returned the unknown status {}", function, status);
    return fmt::format("its {} returned {:.4}{}", function, function, names[status]);
  }
  static constexpr unsigned wants_the_end = 1000;
};

/// A function of the FMU.
struct Function {
  Function(const LoadedLibrary& library, std::string name_of_it)
      : name(std::move(name_of_it)), at(library.find<void>(name.c_str())) {}
  std::string name;
  void* at;
};

/// A variable with the function that sets or gets it.
struct Port : FmuLink, Function {};

/// What a controller needs of an instance, in the words of its FMI. A function that returns a status is called as one
/// that returns a number: they are passed alike.
class Instance {
 public:
  Instance(const LoadedLibrary& library, const FmuFacts& facts, const std::string& resources)
      : is_fmi3_(facts.fmi == 3),
        instantiate_(library, name_of(facts, is_fmi3_ ? "InstantiateCoSimulation" : "Instantiate")),
        set_up_(is_fmi3_ ? std::nullopt : std::optional<Function>({library, "fmi2SetupExperiment"})),
        enter_(library, name_of(facts, "EnterInitializationMode")),
        exit_(library, name_of(facts, "ExitInitializationMode")),
        reset_(library, name_of(facts, "Reset")),
        step_(library, name_of(facts, "DoStep")),
        instance_(nullptr, library.find<void(void*)>(name_of(facts, "FreeInstance").c_str())) {
    if (is_fmi3_) {
      const std::string path = resources + "/";
      instance_.reset(reinterpret_cast<fmi3InstantiateCoSimulationTYPE*>(instantiate_.at)(
          "controller", facts.token.c_str(), path.c_str(), fmi3False, fmi3False, fmi3False, fmi3False, nullptr, 0,
          nullptr, log3, nullptr));
    } else {
      instance_.reset(reinterpret_cast<fmi2InstantiateTYPE*>(instantiate_.at)(
          "controller", fmi2CoSimulation, facts.token.c_str(), file_uri(resources).c_str(), &callbacks_, fmi2False,
          fmi2False));
    }
  }
  [[nodiscard]] static std::string name_of(const FmuFacts& facts, std::string_view function) {
    return fmt::format("fmi{}{}", facts.fmi, function);
  }
  [[nodiscard]] bool made() const { return instance_ != nullptr; }
  /// @param value  of the variable's type: all these functions differ in that alone
  [[nodiscard]] Called pass(const Port& port, void* value) const {
    constexpr std::size_t one = 1;
    return is_fmi3_ ? call(port, &port.reference, one, value, one) : call(port, &port.reference, one, value);
  }
  [[nodiscard]] Called enter() const {
    if (is_fmi3_) return call(enter_, fmi3False, 0.0, 0.0, fmi3False, 0.0);
    const Called called = call(*set_up_, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    return called.worked() ? call(enter_) : called;
  }
  [[nodiscard]] Called exit() const { return call(exit_); }
  [[nodiscard]] Called reset() const { return call(reset_); }
  [[nodiscard]] Called step(double time_s, double step_s) const {
    if (!is_fmi3_) return call(step_, time_s, step_s, fmi2True);
    fmi3Boolean event = fmi3False;
    fmi3Boolean terminate = fmi3False;
    fmi3Boolean early = fmi3False;
    fmi3Float64 last_s = 0.0;
    const Called called = call(step_, time_s, step_s, fmi3True, &event, &terminate, &early, &last_s);
    return called.worked() && terminate ? Called{called.function, Called::wants_the_end} : called;
  }

 private:
  template <class... Arguments>
  [[nodiscard]] Called call(const Function& function, Arguments... arguments) const {
    using Type = unsigned(void*, Arguments...);
    return {function.name.c_str(), reinterpret_cast<Type*>(function.at)(instance_.get(), arguments...)};
  }

  bool is_fmi3_;
  fmi2CallbackFunctions callbacks_{log2, std::calloc, std::free, nullptr, nullptr};
  // In this order they are looked for: an FMU hears of the first that it lacks.
  Function instantiate_;
  std::optional<Function> set_up_;  ///< of FMI 2
  Function enter_;
  Function exit_;
  Function reset_;
  Function step_;
  std::unique_ptr<void, void (*)(void*)> instance_;
};

/// The value as a type of FMI has it: a flag is true but for 0, a whole number the nearest of its range, 0 for NaN.
template <class Value>
Value value_as(double value) noexcept {
  if constexpr (std::is_floating_point_v<Value>) {
    return static_cast<Value>(value);
  } else if constexpr (std::is_enum_v<Value> || std::is_same_v<Value, bool>) {
    return static_cast<Value>(value != 0.0);
  } else {
    using Range = std::numeric_limits<Value>;
    const double whole = std::isnan(value) ? 0.0 : std::round(value);
    if (whole >= static_cast<double>(Range::max())) return Range::max();
    return whole <= static_cast<double>(Range::min()) ? Range::min() : static_cast<Value>(whole);
  }
}

/// The controller in an FMU. A step sets the inputs of this cycle, lets the FMU compute one period, and takes its
/// outputs.
class FmuCode final : public ForeignCode {
 public:
  FmuCode(const ForeignSetup& setup, const FmuFacts& facts)
      : library_(facts.library, setup.file),
        instance_(library_, facts, (setup.folder / "resources").string()),
        inputs_(ports(facts, facts.inputs, "Set")),
        outputs_(ports(facts, facts.outputs, "Get")),
        parameters_(ports(facts, facts.parameters, "Set")),
        period_s_(setup.period_s) {
    if (!instance_.made()) refuse(setup.file, "it cannot be instantiated; the line above says why, if the FMU did");
    begin();
    if (!failed_.worked()) refuse(setup.file, failed_.text() + "; the line above says why, if the FMU did");
  }

  void reset(const abs_hil_input& /*input*/) noexcept override {
    if (!fresh_) restart();
  }
  void step(const abs_hil_input& input, abs_hil_output& output) noexcept override {
    fresh_ = false;
    if (failed_.worked()) ++steps_;
    for (const Port& in : inputs_) call([&] { return set(in, field_of(&input, in.offset)); });
    call([&] { return instance_.step(static_cast<double>(steps_ - 1) * period_s_, period_s_); });
    for (const Port& out : outputs_) {
      double value = std::numeric_limits<double>::quiet_NaN();
      call([&] { return get(out, value); });
      put_field(&output, out.offset, value);
    }
    if (!failed_.worked()) output.brake_torque_Nm = std::numeric_limits<double>::quiet_NaN();
  }
  void be_fresh() noexcept override { restart(); }
  [[nodiscard]] std::string failure() const override {
    if (failed_.worked()) return {};
    return steps_ == 0 ? failed_.text() + " before its first step"
                       : fmt::format("{} in step {}", failed_.text(), steps_);
  }

 private:
  std::vector<Port> ports(const FmuFacts& facts, const std::vector<FmuLink>& links, const std::string& deed) const {
    std::vector<Port> ports;
    for (const FmuLink& link : links) {
      ports.push_back({link, {library_, Instance::name_of(facts, deed + std::string(link.type.functions))}});
    }
    return ports;
  }
  [[nodiscard]] Called set(const Port& port, double value) const {
    return std::visit(
        [&]<class Value>(Value) {
          Value its = value_as<Value>(value);
          return instance_.pass(port, &its);
        },
        port.type.zero);
  }
  [[nodiscard]] Called get(const Port& port, double& value) const {
    return std::visit(
        [&](auto its) {
          const Called called = instance_.pass(port, &its);
          if (called.worked()) value = static_cast<double>(its);
          return called;
        },
        port.type.zero);
  }
  /// Nothing more is called after a failure.
  template <class Call>
  void call(const Call& function) {
    if (failed_.worked()) failed_ = function();
  }
  void begin() {
    for (const Port& p : parameters_) call([&] { return set(p, p.wanted); });
    call([&] { return instance_.enter(); });
    call([&] { return instance_.exit(); });
    fresh_ = failed_.worked();
  }
  void restart() noexcept {
    failed_ = {};
    steps_ = 0;
    call([&] { return instance_.reset(); });
    begin();
  }

  LoadedLibrary library_;
  Instance instance_;
  std::vector<Port> inputs_;
  std::vector<Port> outputs_;
  std::vector<Port> parameters_;
  double period_s_;
  std::int64_t steps_{0};  ///< since the last reset
  bool fresh_{false};
  Called failed_{};  ///< the last call, and the first that failed
};

}  // namespace

std::unique_ptr<ForeignCode> load_fmu(const ForeignSetup& setup) {
  return std::make_unique<FmuCode>(setup, facts_of(setup.file, setup.folder, setup.mapping));
}

}  // namespace abs_hil::interchange
