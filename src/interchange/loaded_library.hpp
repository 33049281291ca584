#pragma once

#include <dlfcn.h>

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

namespace abs_hil::interchange {

/// A shared library in this process. Its constructors have run.
class LoadedLibrary {
 public:
  /// Throws std::invalid_argument with the loader's reason.
  explicit LoadedLibrary(const std::filesystem::path& file)
      // With RTLD_NOW a missing function of another library shows here, before any code runs. A name without a slash
      // would be looked for elsewhere.
      : handle_(::dlopen(std::filesystem::absolute(file).c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (!handle_) throw std::invalid_argument(file.string() + ": " + ::dlerror());
  }
  /// The function of that name; null if there is none.
  template <class Function>
  void find(const char* name, Function*& function) const noexcept {
    function = reinterpret_cast<Function*>(::dlsym(handle_.get(), name));
  }

 private:
  struct Close {
    void operator()(void* handle) const noexcept { ::dlclose(handle); }
  };
  std::unique_ptr<void, Close> handle_;
};

}  // namespace abs_hil::interchange
