// Text from elsewhere is cleaned before it goes into a file.
#include "catch.hpp"
#include "rig/formatted_text.hpp"

using namespace abs_hil::rig;

TEST_CASE("Cleaned text is valid UTF-8 without control characters") {
  CHECK(clean_text("Acosta-Lúa θ̂") == "Acosta-Lúa θ̂");
  CHECK(clean_text("a\nb\x1b[31m\x7f") == "a\uFFFDb\uFFFD[31m\uFFFD");
  CHECK(clean_text("\xff\xc3") == "\uFFFD\uFFFD");
  CHECK(clean_text("\xc0\xaf") == "\uFFFD\uFFFD");            // overlong slash
  CHECK(clean_text("\xed\xa0\x80") == "\uFFFD\uFFFD\uFFFD");  // surrogate
  CHECK(clean_text("\xe2\x80\xae"
                   "evil") == "\uFFFDevil");  // right-to-left override
  CHECK(clean_text("ααααα", 3) == "ααα…");
  CHECK(clean_text("a\n\tb", 9, "\n") == "a\n\uFFFDb");
}

TEST_CASE("Text is UTF-8 or not, control characters or none") {
  CHECK(is_utf8(""));
  CHECK(is_utf8("θ̂\n\x1b"));
  for (const char* text : {"\xff", "a\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80"}) CHECK_FALSE(is_utf8(text));
}
