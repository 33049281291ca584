// Reads, writes and compares the records of commissioned boards.
#include "experiment/board_record.hpp"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "abs_hil/rig/option.hpp"
#include "files/result_file.hpp"
#include "rig/formatted_text.hpp"
#include "rig/parse_json.hpp"

namespace abs_hil::experiment {

namespace {

namespace fs = std::filesystem;

constexpr int record_format = 2;  // 1 had no checksum

/// The values of all options, as text.
template <class Options>
std::map<std::string, std::string> texts_of(Options options, const std::string& prefix) {
  std::map<std::string, std::string> texts;
  rig::for_each_option(options, prefix, [&](const std::string& name, const rig::OptionFacts&, const auto& value) {
    texts[name] = fmt::format("{}", value);
  });
  return texts;
}

/// The rig's parameters, as text. The name of their source tells nothing: its file may have changed.
std::map<std::string, std::string> identity_texts(const RigIdentity& identity) {
  return texts_of(identity.parameters, "rig.");
}

bool is_cap(const std::string& name) { return name.ends_with("_duty_max"); }

std::string file_name(const BoardRecord& record) {
  return rig::plain_name(record.kind + '-' + (record.board.place.empty() ? "board" : record.board.place), "-.") +
         ".json";
}

nlohmann::ordered_json optional_json(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json to_json(const BoardRecord& r) {
  return {{"abs_hil_board_record", record_format},
          {"driver_kind", r.kind},
          {"place", r.board.place},
          {"logic", r.board.logic},
          {"emulated", r.emulated},
          {"date", r.date},
          {"version", r.version},
          {"encoder_counts_per_rev", r.encoder_counts_per_rev},
          {"counts_of_one_turn", {{"upper", r.one_turn.upper}, {"lower", r.one_turn.lower}}},
          {"options", r.options},
          {"identity", r.identity},
          {"outputs",
           {{"reported", r.outputs.reported},
            {"watchdog_ms", optional_json(r.outputs.watchdog_ms)},
            {"watched_ms", r.outputs.watched_ms},
            {"release_ms", optional_json(r.outputs.release_ms)}}}};
}

/// Of the record without its checksum: it tells a record that somebody has edited from one that was measured.
std::string checksum_of(const nlohmann::ordered_json& json) {
  const std::string text = json.dump();
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  return fmt::format("{:08x}", crc.checksum());
}

/// What `difference` compares. Throws nlohmann::json::exception or std::runtime_error.
BoardRecord parse_record(std::istream& in) {
  auto json = rig::parse_json<nlohmann::ordered_json>(in);
  if (json.at("abs_hil_board_record") != record_format) {
    throw std::runtime_error("of another format, as an earlier version wrote it; commission the board again");
  }
  const std::string checksum = json.at("checksum");
  json.erase("checksum");
  if (checksum != checksum_of(json)) {
    throw std::runtime_error("it was edited after the commissioning, its checksum does not fit; commission again");
  }
  return {.kind = json.at("driver_kind"),
          .board = {.place = json.at("place"), .logic = json.at("logic")},
          .emulated = json.at("emulated"),
          .options = json.at("options"),
          .encoder_counts_per_rev = json.at("encoder_counts_per_rev"),
          .identity = json.at("identity"),
          .one_turn = {.upper = json.at("counts_of_one_turn").at("upper"),
                       .lower = json.at("counts_of_one_turn").at("lower")},
          .date = json.at("date"),
          .version = json.at("version")};
}

/// Why the record in this file does not hold; empty if it does, nothing if there is no such file.
std::optional<std::string> difference_of_file(const fs::path& file, const BoardRecord& present) {
  std::ifstream in(file);
  if (!in) return std::nullopt;
  try {
    const std::string why = difference(parse_record(in), present);
    return why.empty() ? why : file.string() + ": " + why;
  } catch (const std::exception& error) {
    return file.string() + " is no commissioning record: " + error.what();
  }
}

std::string described(const driver::BoardIdentity& board) {
  return (board.place.empty() ? "board" : board.place) + (board.logic.empty() ? "" : ", " + board.logic);
}

/// `abs_hil commission` with the options of `driver.` that differ from their defaults, and the identity's source.
std::string commission_command(const driver::DriverOptions& options, const RigIdentity& identity) {
  auto defaults = texts_of(driver::DriverOptions{}, "driver.");
  std::string command = "abs_hil commission";
  rig::for_each_option(options, "driver.", [&](const std::string& name, const rig::OptionFacts&, const auto& value) {
    const std::string text = fmt::format("{}", value);
    if (text != defaults[name]) command += " --set " + name + '=' + text;
  });
  if (identity.source != RigIdentity{}.source) command += " --set rig.identity=" + identity.source;
  return command;
}

}  // namespace

BoardRecord describe_board(const driver::DriverOptions& options, const RigIdentity& identity,
                           const driver::BoardIdentity& board, bool emulated) {
  const driver::ChosenBackend chosen = driver::chosen_backend(options);
  const std::string prefix = "driver." + options.kind + '.';
  BoardRecord record{.kind = options.kind,
                     .board = board,
                     .emulated = emulated,
                     .options = texts_of(chosen.options, prefix),
                     .encoder_counts_per_rev = options.encoder_counts_per_rev,
                     .identity = identity_texts(identity)};
  for (const std::string_view free : chosen.entry.free_options) record.options.erase(prefix + std::string(free));
  return record;
}

std::string difference(const BoardRecord& record, const BoardRecord& present) {
  if (record.emulated) return "it is the record of an emulator";
  if (record.kind != present.kind || record.board.place != present.board.place) {
    return "it is the record of another board, " + record.kind + ' ' + described(record.board);
  }
  if (record.board.logic != present.board.logic) {
    return "the board had " + record.board.logic + " then and has " + present.board.logic + " now";
  }
  if (record.encoder_counts_per_rev != present.encoder_counts_per_rev) {
    return rig::formatted("rig.encoder_counts_per_rev was %d then and is %d now", record.encoder_counts_per_rev,
                          present.encoder_counts_per_rev);
  }
  for (const auto& [name, now] : present.options) {
    const auto then = record.options.find(name);
    if (then == record.options.end()) return "it does not have " + name;
    const bool lower = is_cap(name) && std::strtod(now.c_str(), nullptr) <= std::strtod(then->second.c_str(), nullptr);
    if (now != then->second && !lower) return name + " was " + then->second + " then and is " + now + " now";
  }
  const auto defaults = identity_texts({});
  for (const auto& [name, now] : present.identity) {
    // When a record is older than a key, the rig was taken to have the key's default.
    const auto then = record.identity.find(name);
    const std::string& before = then == record.identity.end() ? defaults.at(name) : then->second;
    if (now != before) {
      return "the rig's identity, from which the limits come, has changed: " + name + " was " + before +
             " then and is " + now + " now (rig.identity names the rig's file)";
    }
  }
  return {};
}

fs::path state_folder() {
  const char* state = std::getenv("XDG_STATE_HOME");
  const char* home = std::getenv("HOME");
  if (state != nullptr && *state == '/') return fs::path(state) / "abs_hil";
  return home != nullptr && *home == '/' ? fs::path(home) / ".local/state/abs_hil" : fs::path("/var/lib/abs_hil");
}

std::vector<fs::path> record_folders(const std::string& configured) {
  if (!configured.empty()) return {configured};
  return {"/var/lib/abs_hil/boards", state_folder() / "boards"};
}

fs::path write_record(const BoardRecord& record, const std::vector<fs::path>& folders) {
  std::string problems;
  for (const fs::path& folder : folders) {
    std::error_code error;
    fs::create_directories(folder, error);
    const fs::path file = folder / file_name(record);
    try {
      nlohmann::ordered_json json = to_json(record);
      json["checksum"] = checksum_of(json);
      files::write_result(file, "commissioning record", json.dump(2) + '\n');
      return file;
    } catch (const files::FileError& failure) {
      problems += (problems.empty() ? "" : "; ") + file.string() + ": " + std::strerror(failure.error_number());
    }
  }
  throw driver::Unavailable(
      "the commissioning record cannot be written (" + problems +
      "); give a folder with --set driver.records=DIR, or make one: sudo install -d -g abs_hil -m "
      "2775 /var/lib/abs_hil/boards");
}

std::string why_not_commissioned(const BoardRecord& present, const std::vector<fs::path>& folders) {
  std::string none;
  for (const fs::path& folder : folders) {
    if (const auto found = difference_of_file(folder / file_name(present), present)) return *found;
    none += (none.empty() ? "no record in " : " or ") + folder.string();
  }
  return none;
}

void require_record(const driver::DriverOptions& options, const RigIdentity& identity,
                    const driver::BoardIdentity& board) {
  const std::string why =
      why_not_commissioned(describe_board(options, identity, board, false), record_folders(options.records));
  if (why.empty()) return;
  throw driver::Unavailable(
      "backend rig: this board (" + options.kind + ' ' + described(board) +
      ") has not been commissioned as it is now: " + why +
      ". Nothing but commission, safe and doctor uses it. Type: " + commission_command(options, identity));
}

}  // namespace abs_hil::experiment
