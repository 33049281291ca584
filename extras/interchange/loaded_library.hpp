#pragma once

#include <dlfcn.h>

#include <filesystem>
#include <memory>
#include <string>

#include "interchange/foreign_code.hpp"
#include "rig/error_words.hpp"

namespace abs_hil::interchange {

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
