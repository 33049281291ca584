#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::report::mat {

/// Parts of a MAT-file of version 5 ("MAT-File Format", The MathWorks), uncompressed, little-endian. Each function
/// returns a complete data element. Texts are ASCII; other characters become question marks.

[[nodiscard]] std::string header();
[[nodiscard]] std::string column(std::string_view name, std::span<const double> values);
[[nodiscard]] std::string text(std::string_view name, std::string_view value);
[[nodiscard]] std::string texts(std::string_view name, const std::vector<std::string>& values);

/// A row of structs. @param fields  elements of all structs, struct by struct, in the order of `names`
[[nodiscard]] std::string structs(std::string_view name, const std::vector<std::string>& names,
                                  const std::vector<std::string>& fields);

/// Converts a text to a valid field name in Octave and MATLAB.
[[nodiscard]] std::string field_name(std::string_view name);

}  // namespace abs_hil::report::mat
