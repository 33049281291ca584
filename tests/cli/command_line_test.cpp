// The parser of the command line: its answers, messages and statuses.
#include "cli/command_line.hpp"

#include <cstdlib>
#include <iostream>
#include <iterator>
#include <sstream>

#include "catch.hpp"

using namespace abs_hil;
using Texts = std::vector<std::string>;

namespace {

/// What a parser returned and printed.
struct Answer {
  std::optional<int> status{};
  std::string out{};
  std::string err{};
};

/// Keeps what a stream is given, until the end of its life.
class Capture {
 public:
  explicit Capture(std::ostream& stream) : stream_(stream), before_(stream.rdbuf(kept_.rdbuf())) {}
  ~Capture() { stream_.rdbuf(before_); }
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;
  [[nodiscard]] std::string text() const { return kept_.str(); }

 private:
  std::ostringstream kept_{};
  std::ostream& stream_;
  std::streambuf* before_;
};

Answer answer_of(cli::Parser& parser, const std::vector<const char*>& arguments) {
  std::vector<const char*> argv{"./typed"};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  const Capture out(std::cout);
  const Capture err(std::cerr);
  const std::optional<int> status = parser.parse(static_cast<int>(argv.size()), argv.data());
  return {status, out.text(), err.text()};
}

struct Row {
  std::string names;
  cli::Target to;
  std::string help;
  cli::Option more{};
};

/// The answer of a parser `rig` with this one option.
Answer answer_of(const Row& row, const std::vector<const char*>& arguments) {
  cli::Parser parser("rig", "");
  parser.add(row.names, row.to, row.help, row.more);
  return answer_of(parser, arguments);
}

/// The error that a command line must have, without the words around it; "none" if it is accepted.
std::string error_of(const Answer& answer) {
  if (!answer.status) return "none";
  CHECK(*answer.status == 2);
  CHECK(answer.out.empty());
  const std::string before = "rig: ";
  const std::string after = " (rig --help shows all options)\n";
  REQUIRE(answer.err.starts_with(before));
  REQUIRE(answer.err.ends_with(after));
  return answer.err.substr(before.size(), answer.err.size() - before.size() - after.size());
}

}  // namespace

TEST_CASE("a row puts its value into a target of its own type") {
  bool flag = false;
  bool off = true;
  int number = 0;
  std::uint16_t small = 0;
  std::uint32_t medium = 0;
  std::uint64_t large = 0;
  double real = 0.0;
  std::string text;
  std::optional<int> maybe_number;
  std::optional<std::string> maybe_text;
  std::optional<std::string> untouched;
  std::string place;
  cli::Parser parser("rig", "");
  parser.add("--flag", &flag, "");
  parser.add("--off", &off, "", {.sets = false});
  parser.add("--number", &number, "");
  parser.add("--small", &small, "");
  parser.add("--medium", &medium, "");
  parser.add("--large", &large, "");
  parser.add("--real", &real, "");
  parser.add("-t,--text", &text, "");
  parser.add("--maybe-number", &maybe_number, "");
  parser.add("--maybe-text", &maybe_text, "");
  parser.add("--untouched", &untouched, "");
  parser.add("place", &place, "");
  const Answer answer = answer_of(parser, {"--flag", "--off", "--number=-3", "--small", "65535", "--medium",
                                           "4294967295", "--large", "18446744073709551615", "--real", "2.5", "-t",
                                           "a b", "--maybe-number", "7", "--maybe-text", "c", "here"});
  CHECK(!answer.status);
  CHECK(answer.out.empty());
  CHECK(answer.err.empty());
  CHECK(flag);
  CHECK(!off);
  CHECK(number == -3);
  CHECK(small == 65535);
  CHECK(medium == 4294967295U);
  CHECK(large == 18446744073709551615U);
  CHECK(real == 2.5);
  CHECK(text == "a b");
  CHECK(maybe_number == 7);
  CHECK(maybe_text == "c");
  CHECK(!untouched);
  CHECK(place == "here");
  CHECK(parser.given() == Texts{"--flag", "--off", "--number", "--small", "--medium", "--large", "--real", "--text",
                                "--maybe-number", "--maybe-text", "place"});
}

TEST_CASE("a value of another type is refused") {
  int number = 1;
  std::uint16_t small = 1;
  double real = 1.0;
  bool flag = false;
  CHECK(error_of(answer_of({"--n", &number, ""}, {"--n", "x"})) == "Could not convert: --n = x");
  CHECK(error_of(answer_of({"--n", &small, ""}, {"--n", "65536"})) == "Could not convert: --n = 65536");
  CHECK(error_of(answer_of({"--n", &real, ""}, {"--n", "1.5V"})) == "Could not convert: --n = 1.5V");
  CHECK(error_of(answer_of({"--n", &flag, ""}, {"--n=x"})) == "Could not convert: --n = x");
  CHECK(error_of(answer_of({"--n", &number, ""}, {"--n"})) == "--n: 1 required INT missing");
}

TEST_CASE("a range includes both ends and no more") {
  std::uint64_t cases = 5;
  const Row integer{"--cases", &cases, "", {.range = {1, 1'000}}};
  CHECK(error_of(answer_of(integer, {"--cases", "1"})) == "none");
  CHECK(cases == 1);
  CHECK(error_of(answer_of(integer, {"--cases", "1000"})) == "none");
  CHECK(error_of(answer_of(integer, {"--cases", "0"})) == "--cases: Value 0 not in range 1 to 1000");
  CHECK(error_of(answer_of(integer, {"--cases", "1001"})) == "--cases: Value 1001 not in range 1 to 1000");
  CHECK(error_of(answer_of(integer, {"--cases", "1.5"})) == "--cases: Value 1.5 not in range 1 to 1000");
  double wait = 5.0;
  const Row real{"--wait", &wait, "", {.range = {0.1, 60.0}}};
  CHECK(error_of(answer_of(real, {"--wait", "0.1"})) == "none");
  CHECK(error_of(answer_of(real, {"--wait", "60"})) == "none");
  CHECK(error_of(answer_of(real, {"--wait", "0.09"})) == "--wait: Value 0.09 not in range 0.100000 to 60.000000");
  CHECK(error_of(answer_of(real, {"--wait", "60.1"})) == "--wait: Value 60.1 not in range 0.100000 to 60.000000");
  for (const char* text : {"nan", "NAN", "inf", "1e999"}) {
    for (const cli::Range range : {cli::Range{}, real.more.range}) {
      CAPTURE(text, range.most);
      const Row option{"--wait", &wait, "", {.range = range}};
      CHECK(error_of(answer_of(option, {"--wait", text})) != "none");
    }
  }
  CHECK(error_of(answer_of(real, {"--wait", "nan"})) == "--wait: Value nan is not a finite number");
}

TEST_CASE("a row may list its values") {
  std::string backend = "sim";
  const Row text{"--backend", &backend, "", {.one_of = {"sim", "rig"}}};
  CHECK(error_of(answer_of(text, {"--backend", "rig"})) == "none");
  CHECK(backend == "rig");
  CHECK(error_of(answer_of(text, {"--backend", "other"})) == "--backend: other not in {sim,rig}");
  std::uint32_t bit = 0;
  const Row number{"--bit", &bit, "", {.one_of = {"0", "2"}}};
  CHECK(error_of(answer_of(number, {"--bit", "02"})) == "none");  // the number 2, not the text
  CHECK(bit == 2);
  CHECK(error_of(answer_of(number, {"--bit", "1"})) == "--bit: 1 not in {0,2}");
}

TEST_CASE("a list takes all values that follow, or one each time") {
  Texts all;
  CHECK(error_of(answer_of({"--bdf", &all, ""}, {"--bdf", "a", "b"})) == "none");
  CHECK(all == Texts{"a", "b"});
  Texts each;
  const Row repeated{"--set", &each, "", {.repeated = true}};
  CHECK(error_of(answer_of(repeated, {"--set", "a=1", "--set", "b=2"})) == "none");
  CHECK(each == Texts{"a=1", "b=2"});
  CHECK(error_of(answer_of(repeated, {"--set", "a=1", "b=2"})) == "unexpected argument b=2");
  std::string once;
  CHECK(error_of(answer_of({"--out", &once, ""}, {"--out", "a", "--out", "b"})) ==
        "--out: At Most 1 required but received 2");
}

TEST_CASE("a row may require values") {
  Texts order;
  const Row row{"order", &order, "", {.count = {.least = 2, .most = 3}, .required = true}};
  CHECK(error_of(answer_of(row, {"a", "b", "c"})) == "none");
  CHECK(order == Texts{"a", "b", "c"});
  CHECK(error_of(answer_of(row, {})) == "order is required");
  CHECK(error_of(answer_of(row, {"a"})) == "order: At least 2 required but received 1");
  CHECK(error_of(answer_of(row, {"a", "b", "c", "d"})) == "order: At Most 3 required but received 4");
}

TEST_CASE("a row may exclude another, in a group too") {
  const auto error = [](const std::vector<const char*>& arguments) {
    std::string can, truth;
    bool once = false;
    double wait = 0.0;
    cli::Parser parser("rig", "");
    cli::Parser board = parser.add_group("board", "", {});
    board.add("--can", &can, "");
    parser.add("--truth", &truth, "", {.excludes = {"--can"}});
    parser.add("--once", &once, "");
    parser.add("--wait", &wait, "", {.excludes = {"--can", "--truth"}});
    return error_of(answer_of(parser, arguments));
  };
  CHECK(error({"--truth", "t", "--once"}) == "none");
  CHECK(error({"--truth", "t", "--can", "c"}) == "--truth excludes --can");
  CHECK(error({"--can", "c", "--once", "--wait", "1"}) == "--wait excludes --can");
  CHECK(error({"--truth", "t", "--once", "--wait", "1"}) == "--truth excludes --wait");
  bool flag = false;
  CHECK_THROWS(answer_of({"--flag", &flag, "", {.excludes = {"--nothing"}}}, {}));
}

TEST_CASE("a group counts its options") {
  const auto error = [](cli::Count count, const std::vector<const char*>& arguments) {
    bool a = false, b = false;
    cli::Parser parser("rig", "");
    cli::Parser group = parser.add_group("board", "", count);
    group.add("--a", &a, "");
    group.add("--b", &b, "");
    return error_of(answer_of(parser, arguments));
  };
  CHECK(error({.least = 1, .most = 1}, {"--b"}) == "none");
  CHECK(error({.least = 1, .most = 1}, {}) == "Exactly 1 option from [--a,--b] is required");
  CHECK(error({.least = 1, .most = 1}, {"--a", "--b"}) ==
        "Exactly 1 option from [--a,--b] is required and 2 were given");
  CHECK(error({.least = 0, .most = 1}, {}) == "none");
  CHECK(error({.least = 0, .most = 1}, {"--a", "--b"}) == "Requires at most 1 options be given from [--a,--b]");
}

TEST_CASE("a command line has one subcommand at most, and errors name it") {
  bool fast = false, json = false;
  cli::Parser parser("rig", "");
  parser.add("--fast", &fast, "");
  cli::Parser list = parser.add_subcommand("list", "");
  list.add("--json", &json, "");
  const cli::Parser watch = parser.add_subcommand("watch", "");
  CHECK(!answer_of(parser, {"--fast", "list", "--json"}).status);
  CHECK(fast);
  CHECK(json);
  CHECK(list.parsed());
  CHECK(!watch.parsed());
  CHECK(parser.given() == Texts{"--fast"});
  CHECK(list.given() == Texts{"--json"});
  {
    const Capture err(std::cerr);
    CHECK(parser.refuse("too much") == 2);
    CHECK(err.text() == "rig: too much (rig list --help shows all options)\n");
  }
  CHECK(!answer_of(parser, {}).status);
  CHECK(!list.parsed());
  CHECK(parser.given().empty());
  const Answer two = answer_of(parser, {"list", "watch"});
  CHECK(two.status == 2);
  CHECK(two.err == "rig: unexpected argument watch (rig list --help shows all options)\n");
}

TEST_CASE("a misspelt word names the nearest valid one") {
  bool fast = false;
  bool json = false;
  cli::Parser parser("rig", "");
  parser.add("--fast", &fast, "");
  cli::Parser list = parser.add_subcommand("list", "");
  list.add("--json", &json, "");
  static_cast<void>(parser.add_subcommand("watch", ""));
  const auto refusal = [&parser](const std::vector<const char*>& words) { return answer_of(parser, words).err; };
  CHECK(refusal({"wach", "--fast"}) ==
        "rig: unknown subcommand wach; the nearest is watch; known: list, watch (rig --help shows all options)\n");
  // A name that nothing is like.
  CHECK(refusal({"drive"}) == "rig: unknown subcommand drive; known: list, watch (rig --help shows all options)\n");
  CHECK(refusal({"--fst", "x"}) == "rig: unknown option --fst; the nearest is --fast (rig --help shows all options)\n");
  CHECK(refusal({"list", "--jason=3"}) ==
        "rig: unknown option --jason; the nearest is --json (rig list --help shows all options)\n");
  // The word that is wrong is the first one, not the last.
  CHECK(refusal({"--fst", "list"}) ==
        "rig: unknown option --fst; the nearest is --fast (rig list --help shows all options)\n");
}

TEST_CASE("help and version go to the standard output and end the program well") {
  std::string backend = "sim";
  std::uint64_t repeat = 100;
  std::optional<std::string> vary;
  cli::Parser parser("rig", "Drives the rig");
  parser.set_version("1.2.3");
  parser.set_footer("See also the manual.");
  parser.add("--backend", &backend, "where", {.one_of = {"sim", "rig"}, .show_default = true});
  parser.add("--repeat", &repeat, "runs", {.type = "N", .show_default = true});
  parser.add("--vary", &vary, "what varies", {.default_text = "phase"});
  const Answer help = answer_of(parser, {"--help"});
  CHECK(help.status == 0);
  CHECK(help.err.empty());
  CHECK(help.out ==
        "Drives the rig\n"
        "Usage: rig [OPTIONS]\n"
        "\n"
        "Options:\n"
        "  -h,--help                   Print this help message and exit\n"
        "  --version                   Display program version information and exit\n"
        "  --backend TEXT:{sim,rig}=sim\n"
        "                              where\n"
        "  --repeat N=100              runs\n"
        "  --vary TEXT=phase           what varies\n"
        "\n"
        "See also the manual.\n");
  const Answer version = answer_of(parser, {"--version"});
  CHECK(version.status == 0);
  CHECK(version.out == "1.2.3\n");
}

TEST_CASE("help is broken between words at the terminal's width, below the text of its row") {
  std::string file;
  cli::Parser parser("rig", "Drives the rig, and says in one long sentence what it does with it");
  parser.add("--file", &file, "what the controller learns for the next braking on this rig, and no more than that");
  parser.add("--fault", &file, "given as PHASE@SIGNAL:KIND[=PARAMETER][+DELAY] and so on");
  const auto help_at = [&](const char* columns) {
    ::setenv("COLUMNS", columns, 1);
    const std::string help = answer_of(parser, {"--help"}).out;
    ::unsetenv("COLUMNS");
    return help;
  };
  CHECK(help_at("50") ==
        "Drives the rig, and says in one long sentence what\n"
        "it does with it\n"
        "Usage: rig [OPTIONS]\n"
        "\n"
        "Options:\n"
        "  -h,--help                   Print this help\n"
        "      message and exit\n"
        "  --file TEXT                 what the controller\n"
        "      learns for the next braking on this rig,\n"
        "      no more than that\n"
        "  --fault TEXT                given as\n"
        "      PHASE@SIGNAL:KIND[=PARAMETER][+DELAY] and so\n"
        "      on\n"
        "\n");
  CHECK(help_at("62").find("\n                              the next braking on this rig,\n") != std::string::npos);
  const auto words_of = [](const std::string& text) {
    std::istringstream in(text);
    return std::vector<std::string>{std::istream_iterator<std::string>(in), {}};
  };
  for (const char* columns : {"40", "41", "60", "61", "80", "1000", "0", "x"}) {
    CAPTURE(columns);
    const std::string help = help_at(columns);
    CHECK(words_of(help) == words_of(help_at("400")));
  }
}

TEST_CASE("a file to write has an ending of its format, a folder none; any other name is free") {
  std::string csv, folder;
  const Row file{"--csv", &csv, "", {.type = "FILE.csv|FILE.json"}};
  const Row dir{"--out", &folder, "", {.type = "DIR"}};
  for (const char* right : {"a.csv", "a.json", "a", "-", "/dev/stdout", "a.v2", "b.csv.d/a"}) {
    CHECK(error_of(answer_of(file, {"--csv", right})) == "none");
  }
  CHECK(error_of(answer_of(file, {"--csv", "a.pdf"})) == "--csv: a.pdf: give FILE.csv|FILE.json");
  CHECK(error_of(answer_of(dir, {"--out", "runs/a.b"})) == "none");
  CHECK(error_of(answer_of(dir, {"--out", "runs/a.csv"})) == "--out: runs/a.csv: give DIR");
}

TEST_CASE("a word that people try is explained, and an unknown one has no help") {
  cli::Parser parser("rig", "");
  static_cast<void>(parser.add_subcommand("report", ""));
  parser.explain("run", "run is no subcommand: type rig alone");
  const std::string more = " (rig --help shows all options)\n";
  CHECK(answer_of(parser, {"run"}).err == "rig: run is no subcommand: type rig alone" + more);
  CHECK(answer_of(parser, {"run", "--help"}).err == "rig: run is no subcommand: type rig alone" + more);
  const Answer near = answer_of(parser, {"rep", "--help"});
  CHECK(near.status == 2);
  CHECK(near.out.empty());
  CHECK(near.err == "rig: unknown subcommand rep; the nearest is report; known: report" + more);
}

TEST_CASE("a program without a name is called what the user typed") {
  cli::Parser parser("", "Emulates a board");
  const Answer help = answer_of(parser, {"--help"});
  CHECK(help.status == 0);
  CHECK(help.out.find("Usage: ./typed [OPTIONS]\n") != std::string::npos);
  cli::Parser another("", "");
  const Answer error = answer_of(another, {"--nothing"});
  CHECK(error.status == 2);
  CHECK(error.err ==
        "The following argument was not expected: --nothing\n"
        "Run with --help for more information.\n");
}
