// config/can/abs_rig.dbc and the table in the code say the same, signal by signal, in both directions.

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "catch.hpp"
#include "driver/can/protocol.hpp"

using namespace abs_hil::driver::can;

namespace {

struct DbcSignal {
  std::string name;
  unsigned start_bit{0};
  unsigned bits{0};
  char order{'?'};
  char sign{'?'};
  double scale{0.0};
  double offset{0.0};
  double least{0.0};
  double most{0.0};
  std::string unit;
};
struct DbcMessage {
  std::string name;
  unsigned bytes{0};
  std::string sender;
  bool fd{false};
  std::vector<DbcSignal> signals{};
};
using Dbc = std::map<std::uint32_t, DbcMessage>;

DbcSignal signal_in(const std::string& line) {
  DbcSignal s;
  char name[64]{};
  char unit[32]{};
  const int read = std::sscanf(line.c_str(), " SG_ %63s : %u|%u@%c%c (%lf,%lf) [%lf|%lf] \"%31[^\"]\"", name,
                               &s.start_bit, &s.bits, &s.order, &s.sign, &s.scale, &s.offset, &s.least, &s.most, unit);
  REQUIRE(read >= 9);
  s.name = name;
  s.unit = unit;
  return s;
}

Dbc read_dbc(const std::string& path) {
  std::ifstream file(path);
  REQUIRE(file);
  Dbc messages;
  std::uint32_t current = 0;
  for (std::string line; std::getline(file, line);) {
    unsigned id = 0;
    unsigned value = 0;
    char name[64]{};
    char sender[32]{};
    if (std::sscanf(line.c_str(), "BO_ %u %63[^:]: %u %31s", &id, name, &value, sender) == 4) {
      REQUIRE_FALSE(messages.contains(id));
      messages[current = id] = {.name = name, .bytes = value, .sender = sender};
    } else if (line.starts_with(" SG_ ")) {
      messages[current].signals.push_back(signal_in(line));
    } else if (std::sscanf(line.c_str(), "BA_ \"VFrameFormat\" BO_ %u %u", &id, &value) == 2) {
      messages[id].fd = value == 14;
    }
  }
  return messages;
}

void check_same(const Signal& code, const DbcSignal& dbc) {
  INFO(code.name);
  CHECK(dbc.name == code.name);
  CHECK(dbc.start_bit == code.start_bit);
  CHECK(dbc.bits == code.bits);
  CHECK(dbc.order == '1');  // little-endian
  CHECK(dbc.sign == (code.is_signed ? '-' : '+'));
  CHECK(dbc.scale == code.scale);
  CHECK(dbc.offset == 0.0);
  CHECK(dbc.least == code.least);
  CHECK(dbc.most == code.most);
  CHECK(dbc.unit == code.unit);
}

}  // namespace

TEST_CASE("The DBC file and the code agree on every message and signal") {
  const Dbc dbc = read_dbc(ABS_HIL_DBC);
  CHECK(dbc.size() == messages().size());
  for (const Message& message : messages()) {
    INFO(message.name);
    REQUIRE(dbc.contains(message.id));
    const DbcMessage& other = dbc.at(message.id);
    CHECK(other.name == message.name);
    CHECK(other.bytes == message.bytes);
    CHECK(other.sender == (message.from_node ? "Node" : "Host"));
    CHECK(other.fd == message.fd_only);
    REQUIRE(other.signals.size() == message.signals.size());
    for (std::size_t i = 0; i < message.signals.size(); ++i) check_same(message.signals[i], other.signals[i]);
  }
}

TEST_CASE("Signals lie within their message and do not overlap; the check is the last byte") {
  for (const Message& message : messages()) {
    INFO(message.name);
    std::vector<bool> taken(message.bytes * 8U);
    for (const Signal& signal : message.signals) {
      INFO(signal.name);
      REQUIRE(signal.start_bit + signal.bits <= taken.size());
      for (unsigned bit = signal.start_bit; bit < signal.start_bit + signal.bits; ++bit) {
        CHECK_FALSE(taken[bit]);
        taken[bit] = true;
      }
    }
    CHECK(message.signals.back().name == "Check");
    CHECK(message.signals.back().start_bit == (message.bytes - 1U) * 8U);
    CHECK((message.bytes <= 8 || message.fd_only));
  }
}
