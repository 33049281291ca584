// What the system and the loader say, with cause and fix.
#include <dlfcn.h>

#include <cerrno>
#include <filesystem>
#include <fstream>

#include "catch.hpp"
#include "rig/formatted_text.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil::rig;
using abs_hil::test::TemporaryFolder;
using Catch::Matchers::Contains;

namespace fs = std::filesystem;

namespace {

/// What the loader says of a library with these bytes.
std::string loaded(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
  REQUIRE(::dlopen(file.c_str(), RTLD_NOW) == nullptr);
  return refusal(std::string(::dlerror()), file);
}

}  // namespace

TEST_CASE("an errno has the system's words and a fix for what was wanted") {
  CHECK(refusal(ENOENT, "a/b.csv", writing) == "No such file or directory; create the directory first: mkdir -p 'a'");
  CHECK(refusal(ENOENT, "b.csv", writing) == "No such file or directory; create the directory first: mkdir -p '.'");
  CHECK_THAT(refusal(ENOENT, "a/abs_x", starting), Contains("install it"));
  CHECK_THAT(refusal(EACCES, "a/abs_x", starting), Contains("chmod +x 'a/abs_x'") && Contains("noexec"));
  CHECK_THAT(refusal(ENOSPC, "a", writing), Contains("free some space"));
  CHECK_THAT(refusal(EROFS, "a", writing), Contains("read-only"));
  CHECK_THAT(refusal(EMFILE, "a", reading), Contains("ulimit -n"));
  CHECK_THAT(refusal(ENFILE, "a", reading), Contains("fs.file-max"));
  CHECK_THAT(refusal(EADDRINUSE, "127.0.0.1:80", reaching), Contains("another program listens there"));
  CHECK_THAT(refusal(ENETUNREACH, "10.0.0.9", reaching), Contains("ip route"));
  for (int error = 1; error < 134; ++error) {
    for (const Deed deed : {writing, reading, starting, reaching}) {
      const std::string text = refusal(error, "{folder}/{place}", deed);
      CHECK(text.find("; ") < text.size() - 5);
    }
  }
}

TEST_CASE("the loader's words name the cause and the fix") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "x.so";
  // The program itself, from whose head these files are made, is a whole ELF file.
  std::ifstream self("/proc/self/exe", std::ios::binary);
  std::string head(4096, '\0');
  self.read(head.data(), 4096);
  REQUIRE(head.substr(0, 4) ==
          "\x7f"
          "ELF");
  constexpr std::size_t class_at = 4;
  std::string bits32 = head;
  bits32[class_at] = 1;
  CHECK_THAT(loaded(file, bits32), Contains("32 bits"));
  CHECK_THAT(loaded(file, "hello"), Contains("no library for Linux"));
  CHECK_THAT(loaded(file, std::string(500, 'x')), Contains("no library for Linux"));
  fs::remove(file);
  CHECK(::dlopen("libnowhere.so.3", RTLD_NOW) == nullptr);
  CHECK_THAT(refusal(std::string(::dlerror()), file), Contains("install that library") && Contains("LD_LIBRARY_PATH"));
  CHECK_THAT(refusal(file.string() + ": failed to map segment from shared object", file),
             Contains("noexec") && Contains("TMPDIR") && Contains(folder.path.string()));
  CHECK_THAT(refusal("/lib/libc.so.6: version `GLIBC_2.99' not found (required by x)", file), Contains("newer system"));
  CHECK_THAT(refusal("libc.musl-x86_64.so.1: cannot open shared object file: No such file or directory", file),
             Contains("musl") && !Contains("LD_LIBRARY_PATH"));
  CHECK(refusal("other words", file) == "other words");
  CHECK(refusal("other words", file, "do that") == "other words; do that");
}
