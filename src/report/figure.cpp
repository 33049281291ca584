#include "report/figure.hpp"

#include <array>
#include <string_view>

namespace abs_hil::report {

Style run_style(std::size_t run) {
  // Okabe, Ito: "Color Universal Design" (2008). The first two colours also differ strongly in lightness.
  static const std::array<Style, 7> styles{{
      {"#0072B2", "solid", 1.5},
      {"#E69F00", "(14,3)", 1.5},
      {"#009E73", "(7,3)", 1.5},
      {"#D55E00", "(12,3,2,3)", 1.5},
      {"#CC79A7", "(4,2)", 1.5},
      {"#56B4E9", "(12,3,2,3,2,3)", 1.5},
      {"#000000", "(2,2)", 1.5},
  }};
  Style style = styles[run % styles.size()];
  style.point_type = std::array{7, 5, 9, 11, 13, 6, 4}[run % styles.size()];
  return style;
}

std::string phase_colour(const std::string& phase) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 7> colours{{
      {"idle", "#f3f3f3"},
      {"accelerate", "#e6e6e6"},
      {"coast", "#f3f3f3"},
      {"brake", "#ffffff"},
      {"hold", "#e6e6e6"},
      {"stopped", "#f3f3f3"},
      {"fault", "#f7d9cc"},
  }};
  for (const auto& [name, colour] : colours) {
    if (name == phase) return std::string(colour);
  }
  return "#ececec";
}

}  // namespace abs_hil::report
