#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "temporary_folder.hpp"

namespace abs_hil::diagnosis::test {

/// A folder with the files of /proc and /sys that a test puts there.
class FakeSystem {
 public:
  FakeSystem& put(const std::string& path, std::string_view text) {
    const std::filesystem::path file = root() / path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text << '\n';
    return *this;
  }
  FakeSystem& link(const std::string& path, const std::string& target) {
    std::filesystem::create_directories((root() / path).parent_path());
    std::filesystem::create_symlink(target, root() / path);
    return *this;
  }
  [[nodiscard]] const std::filesystem::path& root() const { return folder_.path; }

 private:
  abs_hil::test::TemporaryFolder folder_{};
};

}  // namespace abs_hil::diagnosis::test
