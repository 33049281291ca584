#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "report/figure.hpp"

namespace abs_hil::report {

enum class PictureFormat { svg, png, pdf };

[[nodiscard]] std::string_view extension_of(PictureFormat format);

/// Commands for gnuplot that draw the figures into files named after their ids. Texts from files are in single quotes
/// without markup. The script contains the data.
[[nodiscard]] std::string gnuplot_script(const std::vector<Figure>& figures, PictureFormat format);

/// A new temporary folder, deleted with the object.
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

/// Runs gnuplot in `folder` as a child process without a shell; it writes the pictures there. Throws UnavailableError
/// with the fix if gnuplot is missing, and std::runtime_error with gnuplot's messages if it fails.
void draw(const std::vector<Figure>& figures, PictureFormat format, const std::filesystem::path& folder);

/// Adds fallback fonts to an SVG of gnuplot, for computers without its font.
[[nodiscard]] std::string with_common_fonts(std::string svg);

/// Prepares an SVG of gnuplot for a page: a bare `svg` element whose curves are marked with class, run, quantity and
/// number of points, and whose ids do not clash with those of other pictures.
[[nodiscard]] std::string embeddable_svg(const std::string& svg, const Figure& figure);

}  // namespace abs_hil::report
