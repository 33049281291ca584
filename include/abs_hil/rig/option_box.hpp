#pragma once

#include <any>
#include <string>
#include <utility>

#include "abs_hil/rig/option.hpp"

namespace abs_hil::rig {

/// Options of a type that only their owner knows: a backend, or a controller. A copy is a copy of the options.
class OptionBox {
 public:
  template <class Options>
  [[nodiscard]] static OptionBox of(Options options) {
    OptionBox held;
    held.options_ = std::move(options);
    held.visit_ = [](std::any& any, const std::string& prefix, const OptionVisitor& visit) {
      for_each_option(
          std::any_cast<Options&>(any), prefix,
          [&visit](const std::string& name, const OptionFacts& facts, auto& value) { visit(name, facts, &value); });
    };
    return held;
  }

  /// The options if they have this type, otherwise null.
  template <class Options>
  [[nodiscard]] Options* as() noexcept {
    return std::any_cast<Options>(&options_);
  }
  template <class Options>
  [[nodiscard]] const Options* as() const noexcept {
    return std::any_cast<Options>(&options_);
  }
  void visit_options(const std::string& prefix, const OptionVisitor& visit) { visit_(options_, prefix, visit); }

 private:
  OptionBox() = default;

  std::any options_{};
  void (*visit_)(std::any& options, const std::string& prefix, const OptionVisitor& visit){nullptr};
};

}  // namespace abs_hil::rig
