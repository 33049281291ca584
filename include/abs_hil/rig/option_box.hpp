#pragma once

#include <memory>
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
    held.box_ = std::make_unique<Box<Options>>(std::move(options));
    return held;
  }
  OptionBox(const OptionBox& other) : box_(other.box_ ? other.box_->copy() : nullptr) {}
  OptionBox& operator=(const OptionBox& other) {
    box_ = other.box_ ? other.box_->copy() : nullptr;
    return *this;
  }
  OptionBox(OptionBox&&) noexcept = default;
  OptionBox& operator=(OptionBox&&) noexcept = default;
  ~OptionBox() = default;

  /// The options if they have this type, otherwise null.
  template <class Options>
  [[nodiscard]] Options* as() noexcept {
    auto* box = dynamic_cast<Box<Options>*>(box_.get());
    return box == nullptr ? nullptr : &box->options;
  }
  template <class Options>
  [[nodiscard]] const Options* as() const noexcept {
    const auto* box = dynamic_cast<const Box<Options>*>(box_.get());
    return box == nullptr ? nullptr : &box->options;
  }
  void visit_options(const std::string& prefix, const OptionVisitor& visit) { box_->visit(prefix, visit); }

 private:
  struct AnyBox {
    AnyBox() = default;
    AnyBox(const AnyBox&) = delete;
    AnyBox& operator=(const AnyBox&) = delete;
    virtual ~AnyBox() = default;
    [[nodiscard]] virtual std::unique_ptr<AnyBox> copy() const = 0;
    virtual void visit(const std::string& prefix, const OptionVisitor& visit) = 0;
  };
  template <class Options>
  struct Box final : AnyBox {
    explicit Box(Options held) : options(std::move(held)) {}
    [[nodiscard]] std::unique_ptr<AnyBox> copy() const override { return std::make_unique<Box>(options); }
    void visit(const std::string& prefix, const OptionVisitor& visit) override {
      for_each_option(options, prefix, [&visit](const std::string& name, const OptionFacts& facts, auto& value) {
        visit(name, facts, &value);
      });
    }
    Options options;
  };

  OptionBox() = default;
  std::unique_ptr<AnyBox> box_{};
};

}  // namespace abs_hil::rig
