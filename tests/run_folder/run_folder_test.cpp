// Run folders: making one, its name, its seal.
#include "run_folder/run_folder.hpp"

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "catch.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil::run_folder;
namespace fs = std::filesystem;

namespace {

using abs_hil::test::TemporaryFolder;

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

TEST_CASE("SHA-256 gives the digests of FIPS 180-4's examples") {
  CHECK(sha256_of("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  CHECK(sha256_of("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq") ==
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST_CASE("a folder is created with its parents, and sealed with the checksums of its files") {
  const TemporaryFolder place;
  const RunFolder folder(place.path / "a" / "b");
  folder.write("z.txt", std::string_view("abc"));
  folder.write("a.json", nlohmann::ordered_json{{"x", 1}});
  folder.seal();
  const std::string sums = text_of(folder.of(file::checksums));
  CHECK(sums == sha256_of("{\n  \"x\": 1\n}\n") + "  a.json\n" + sha256_of("abc") + "  z.txt\n");
}

TEST_CASE(
    "a sealed folder whose file has changed is refused by the file's name; a folder without a seal is not judged") {
  const TemporaryFolder place;
  const RunFolder folder(place.path / "run");
  folder.write("run.csv", std::string_view("rows"));
  folder.write("summary.json", std::string_view("{}"));
  CHECK_NOTHROW(check_seal(folder.path()));
  folder.seal();
  CHECK_NOTHROW(check_seal(folder.path()));
  std::ofstream(folder.of("notes.txt")) << "added later";
  CHECK_NOTHROW(check_seal(folder.path()));
  std::ofstream(folder.of("summary.json")) << "{} ";
  CHECK_THROWS_WITH(check_seal(folder.path()), Catch::Matchers::Contains("summary.json\" is not as it was recorded"));
  fs::remove(folder.of("summary.json"));  // its reader says so
  CHECK_NOTHROW(check_seal(folder.path()));
  for (const char* damaged : {"", "abc\n", "../x"}) {
    std::ofstream(folder.of(file::checksums)) << damaged;
    CHECK_THROWS_WITH(check_seal(folder.path()), Catch::Matchers::Contains("SHA256SUMS"));
  }
}

TEST_CASE("a folder that is not empty, a file, and an unwritable path are refused by name") {
  const TemporaryFolder place;
  std::ofstream(place.path / "file") << "x";
  CHECK_THROWS_WITH(RunFolder(place.path),
                    Catch::Matchers::Contains(place.path.string()) && Catch::Matchers::Contains("not empty"));
  CHECK_THROWS_WITH(RunFolder(place.path / "file"), Catch::Matchers::Contains("is a file"));
  CHECK_THROWS_WITH(RunFolder(place.path / "file" / "below"), Catch::Matchers::Contains("file/below"));
  CHECK(text_of(place.path / "file") == "x");
}

TEST_CASE("folders are named by time and experiment, and never taken twice") {
  const TemporaryFolder place;
  std::tm time{};
  time.tm_year = 126;
  time.tm_mon = 10;
  time.tm_mday = 21;
  time.tm_hour = 13;
  time.tm_min = 4;
  time.tm_sec = 9;
  const fs::path first = unused_folder(place.path, time, "labs/ice run.toml");
  CHECK(first == place.path / "20261121-130409-ice-run");
  CHECK(fs::is_directory(first));  // made at once, so that no other program takes it in the same second
  CHECK(unused_folder(place.path, time, "ice run") == place.path / "20261121-130409-ice-run-2");
  CHECK(unused_folder(place.path, time, "v1.5 of it").filename() == "20261121-130409-v1.5-of-it");
  for (const std::string& name : {std::string(400, 'x'), std::string(400, 'x'), std::string("x.toml")}) {
    const fs::path made = unused_folder(place.path, time, name);
    CHECK(fs::is_directory(made));
    CHECK(made.filename().string().size() <= 255);
  }
}

TEST_CASE("names of folders keep their letters") {
  const TemporaryFolder place;
  const auto name = [&](std::string_view text) { return folder_name(text, place.path); };
  CHECK(name("paper") == "paper");
  CHECK(name("Übergang, nasse Straße") == "Ubergang-nasse-Strasse");
  CHECK(name("Brémond à l'été") == "Bremond-a-l-ete");
  CHECK(name("Łódź ø æ Œ ğ ş ı ậ") == "Lodz-o-ae-OE-g-s-i-ậ");
  CHECK(name("µ-split") == "m-split");
  CHECK(name("a\u0308o\u0308") == "ao");  // with the mark as a character of its own
  CHECK(name("λ=0.2") == "l=0.2");
  CHECK(name("Ελλάδα") == "Ellada");
  CHECK(name("опыт, Ёж, Київ, объём") == "opyt-Yozh-Kiyiv-obyom");
  CHECK(name("制动 1") == "制动-1");
  CHECK(name("a/b\\c:d*e?f\"g<h>i|j\nk") == "a-b-c-d-e-f-g-h-i-j-k");
  CHECK(name("..") == "unnamed");
  CHECK(name("") == "unnamed");
  CHECK(name("🚗") == "unnamed");
  CHECK(name("\xff\xfe"
             "abc") == "c");  // no UTF-8
  CHECK(name("\u202Ea\u200Bb") == "a-b");
}

TEST_CASE("names of folders end at a character, within what the file system takes") {
  const TemporaryFolder place;
  for (const std::size_t spare : {0, 1, 2, 3, 40}) {
    std::string text;
    while (text.size() < 600) text += "动";
    const std::string name = folder_name(text, place.path, spare);
    CHECK(name.size() <= 255 - spare);
    CHECK(name.size() > 255 - spare - 3);
    CHECK(name.size() % 3 == 0);
    CHECK(fs::create_directory(place.path / name));
    fs::remove(place.path / name);
  }
}
