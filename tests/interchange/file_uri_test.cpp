// URIs of files by RFC 3986 and RFC 8089: made, read, and read as Windows reads them.
#include "interchange/file_uri.hpp"

#include <string>

#include "catch.hpp"

using abs_hil::interchange::file_uri;
using abs_hil::interchange::path_of_uri;

TEST_CASE("every byte of a path survives the way through its URI") {
  std::string all = "/";
  for (int byte = 1; byte < 256; ++byte) all += static_cast<char>(byte);
  const std::string uri = file_uri(all);
  CHECK(path_of_uri(uri, false) == all);
  CHECK(uri.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._~/%:") == uri.npos);
  for (const char* path :
       {"/", "/tmp/50% of it", "/a%41b", "/a b", "/x:/resources", "/über/制动", "/a#b?c&d", "//a", "/%"}) {
    CHECK(path_of_uri(file_uri(path), false) == path);
  }
  CHECK(file_uri("/tmp/50% of it") == "file:///tmp/50%25%20of%20it");
}

TEST_CASE("all forms of an URI name the same file") {
  for (const char* uri : {"file:///tmp/a%20b", "file:/tmp/a%20b", "file://localhost/tmp/a%20b",
                          "FILE://LocalHost/tmp/a%20b", "file:///tmp/a b", "/tmp/a b", "file:///%74mp/a%20b"}) {
    CHECK(path_of_uri(uri, false) == "/tmp/a b");
  }
  CHECK(path_of_uri("/tmp/a%20b", false) == "/tmp/a%20b");  // a path, as of FMI 3
  CHECK(path_of_uri("file:///a%2", false) == "/a%2");
  CHECK(path_of_uri("file:///a%", false) == "/a%");
  CHECK(path_of_uri("file:///a%zz%-1%+1", false) == "/a%zz%-1%+1");
  CHECK(path_of_uri("file:///C:/a", false) == "/C:/a");
  CHECK(path_of_uri("", false).empty());
  CHECK(path_of_uri("file:", false).empty());
  CHECK_THROWS_WITH(path_of_uri("file://server/a", false), Catch::Matchers::Contains("server"));
  CHECK_THROWS_WITH(path_of_uri("file:///a%00b", false), Catch::Matchers::Contains("zero byte"));
}

TEST_CASE("Windows has drives and other computers") {
  for (const char* uri :
       {"file:///C:/a%20b", "file:/C:/a%20b", "file://localhost/C:/a%20b", "file:///C%3A/a b", "file:///C|/a b"}) {
    CHECK(path_of_uri(uri, true) == "C:/a b");
  }
  CHECK(path_of_uri("C:\\a b", true) == "C:\\a b");
  CHECK(path_of_uri("file://server/share/a", true) == "//server/share/a");
}
