#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "report/figure.hpp"

namespace abs_hil::report {

enum class PictureFormat { svg, png, pdf };

[[nodiscard]] std::string_view extension_of(PictureFormat format);

/// gnuplot's commands that draw the figures into files named by their ids. Texts from files stand in single quotes
/// without markup; the data stand in the script itself.
[[nodiscard]] std::string gnuplot_script(const std::vector<Figure>& figures, PictureFormat format);

/// A folder of one's own that goes with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

/// Runs gnuplot as a child process, without a shell, in `folder`; the pictures are there afterwards. Throws
/// UnavailableError, with the fix, where gnuplot is missing, std::runtime_error with its words where it fails.
void draw(const std::vector<Figure>& figures, PictureFormat format, const std::filesystem::path& folder);

/// An SVG of gnuplot's with other fonts named beside ours, for machines that do not have it.
[[nodiscard]] std::string with_common_fonts(std::string svg);

/// A picture of gnuplot's made part of a page: a bare `svg` element, curves marked with class, run, quantity and number
/// of points, names that do not clash with those of other pictures.
[[nodiscard]] std::string embeddable_svg(const std::string& svg, const Figure& figure);

}  // namespace abs_hil::report
