// The state of an object as bytes, to branch from it or to go on from it later.
#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace abs_hil::rig {

/// Writes the state of an object, or reads it into an object of the same class that was made with the same options by
/// the same build. A class hands over each member that changes, in one function for both directions.
class StateBytes {
 public:
  /// Writes.
  StateBytes() = default;
  /// Reads what `written` gave.
  explicit StateBytes(std::string_view kept) : kept_(kept), reads_(true) {}

  template <class T>
    requires std::is_trivially_copyable_v<T>
  void operator()(T& value) {
    if (!reads_) {
      written_.append(reinterpret_cast<const char*>(&value), sizeof(T));
      return;
    }
    if (kept_.size() < sizeof(T)) refuse();
    std::memcpy(static_cast<void*>(&value), kept_.data(), sizeof(T));
    kept_.remove_prefix(sizeof(T));
  }
  template <class T>
    requires std::is_trivially_copyable_v<T>
  void operator()(std::vector<T>& values) {
    std::uint64_t size = values.size();
    (*this)(size);
    if (reads_ && size > kept_.size() / sizeof(T)) refuse();
    values.resize(size);
    for (T& value : values) (*this)(value);
  }
  template <class First, class... Others>
    requires(sizeof...(Others) > 0)
  void operator()(First& first, Others&... others) {
    (*this)(first);
    ((*this)(others), ...);
  }

  [[nodiscard]] bool reads() const noexcept { return reads_; }
  [[nodiscard]] std::string written() { return std::move(written_); }
  /// To be called behind the last value. Throws std::invalid_argument if not all was read.
  void end() const {
    if (reads_ && !kept_.empty()) refuse();
  }

 private:
  [[noreturn]] static void refuse() {
    throw std::invalid_argument("a kept state that is damaged, or of another version or other options");
  }

  std::string written_{};
  std::string_view kept_{};
  bool reads_{false};
};

}  // namespace abs_hil::rig
