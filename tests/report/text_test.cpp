#include "report/text.hpp"

#include <limits>
#include <string>
#include <vector>

#include "catch.hpp"

using namespace abs_hil::report;

TEST_CASE("Text from files cannot become markup") {
  CHECK(html_escape("<script>\"a\" & 'b'</script>") == "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;&lt;/script&gt;");
}

TEST_CASE("gnuplot's single quotes accept any text") {
  CHECK(gnuplot_quote("it's `touch x` \"$(id)\"") == "'it''s `touch x` \"$(id)\"'");
}

TEST_CASE("Cleaned text is valid UTF-8 without control characters") {
  CHECK(clean_text("Acosta-Lúa θ̂") == "Acosta-Lúa θ̂");
  CHECK(clean_text("a\nb\x1b[31m\x7f") == "a\uFFFDb\uFFFD[31m\uFFFD");
  CHECK(clean_text("\xff\xc3") == "\uFFFD\uFFFD");
  CHECK(clean_text("\xc0\xaf") == "\uFFFD\uFFFD");            // overlong slash
  CHECK(clean_text("\xed\xa0\x80") == "\uFFFD\uFFFD\uFFFD");  // surrogate
  CHECK(clean_text("\xe2\x80\xae"
                   "evil") == "\uFFFDevil");  // right-to-left override
  CHECK(clean_text("ααααα", 3) == "ααα…");
  CHECK(length_of("λ = 0.15") == 8);
}

TEST_CASE("Shortened names stay different") {
  using Names = std::vector<std::string>;
  CHECK(short_names({"paper", "sliding-mode"}, 8) == Names{"paper", "sliding-…"});
  CHECK(short_names({"2026-05-04-paper", "steep", "2026-05-07-paper"}, 8) == Names{"…4-paper", "steep", "…7-paper"});
  CHECK(short_names({"afternoon", "afternoon (2)"}, 8) == Names{"…on", "…on (2)"});
  CHECK(short_names({"Schlüssel-ä-rot", "Schlüssel-ö-rot"}, 8) == Names{"…ä-rot", "…ö-rot"});
  CHECK(short_names({"", ""}, 8) == Names{"…", "…"});
}

TEST_CASE("Numbers are shown with a true minus sign and no minus zero") {
  CHECK(shown(-1.25, 1) == "−1.2");
  CHECK(shown(-0.0001, 2) == "0.00");
  CHECK(shown(std::numeric_limits<double>::quiet_NaN(), 2) == "–");
  CHECK(shown_significant(-2.5e-7, 2) == "−2.5e−07");
}
