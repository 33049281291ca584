#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "config/reader.hpp"

namespace abs_hil::config {

namespace {

/// Reads the values of a profile. The key above may give their unit (`torque_Nm = {...}`), or each number does.
class ValueReader {
 public:
  ValueReader(const Source& source, const Entry& outer) : source_(source), outer_(outer) {}

  [[nodiscard]] Number read(const toml::node& node, std::string_view what) const {
    const Field& field = *outer_.field;
    const bool plain = field.quantity == Quantity::none;
    const Place place = place_of(node.source());
    if (!plain && node.is_number() && !outer_.has_suffix) {
      source_.fail(
          place, fmt::format("{} = {} has no unit; name it in the key {}{} = ... or write \"{} {}\"", what, shown(node),
                             field.facts.key, suffix_of(field.quantity), shown(node), field.facts.unit));
    }
    if (!plain && outer_.has_suffix && node.is_string() && !node.as_string()->get().starts_with('$')) {
      source_.fail(place, fmt::format("{} = {}: the key {} names the unit already; write a plain number", what,
                                      shown(node), outer_.key));
    }
    Field inner = field;
    inner.facts.key = what;
    return read_number(source_, node, inner, what, outer_.has_suffix);
  }

 private:
  const Source& source_;
  const Entry& outer_;
};

Number seconds(double value, Place place) {
  return {.value = value, .unit = "s", .range = {0.0, 86'400.0}, .place = place};
}

class ProfileReader {
 public:
  ProfileReader(const Source& source, const Entry& outer)
      : source_(source),
        outer_(outer),
        values_(source, outer),
        reader_(source, *outer.node->as_table(), profile_grammar(), outer.place) {
    profile_.place = reader_.place();
  }

  ProfileScript read(const FileReader& read_file, std::map<std::string, std::string>& files) {
    only_one_form();
    if (has("from") || has("to") || has("over")) {
      const Number from = value("from");
      const Number to = value("to");
      const Number over = reader_.number(need("over", "a ramp"));
      profile_.points = {{seconds(0.0, from.place), from}, {over, to}};
    } else if (has("before") || has("after") || has("at")) {
      const Number before = value("before");
      const Number after = value("after");
      const Number at = reader_.number(need("at", "a step"));
      profile_.points = {{seconds(0.0, before.place), before}, {at, before}, {at, after}};
    } else if (const Entry* points = reader_.find("points")) {
      read_points(*points);
    } else {
      read_profile(need("file", "a profile"), read_file, files);
    }
    if (const Entry* between = reader_.find("between")) {
      if (!has("points") && !has("file")) {
        source_.fail(between->key_place, "between applies to points or a file only; leave it out");
      }
      if (reader_.choice(*between) == "hold") profile_.between = experiment::Between::hold;
    }
    return profile_;
  }

 private:
  [[nodiscard]] bool has(std::string_view name) const { return reader_.find(name) != nullptr; }

  [[nodiscard]] const Entry& need(std::string_view name, std::string_view form) const {
    const Entry* entry = reader_.find(name);
    if (entry == nullptr) {
      source_.fail(
          reader_.place(),
          fmt::format("{}: {} has no \"{}\"; give a ramp {{ from, to, over_s }}, a step {{ before, after, at_s }}, "
                      "points or a file",
                      outer_.key, form, name));
    }
    return *entry;
  }
  [[nodiscard]] Number value(std::string_view name) const {
    const Entry& entry = need(name, name == "from" || name == "to" ? "a ramp" : "a step");
    return values_.read(*entry.node, entry.key);
  }

  void only_one_form() const {
    const std::array<std::array<std::string_view, 3>, 4> forms{
        {{"from", "to", "over"}, {"before", "after", "at"}, {"points", "", ""}, {"file", "", ""}}};
    std::string_view first;
    for (const auto& form : forms) {
      for (const std::string_view name : form) {
        if (name.empty() || !has(name)) continue;
        if (!first.empty() && std::find(form.begin(), form.end(), first) == form.end()) {
          source_.fail(reader_.find(name)->key_place,
                       fmt::format("{}: \"{}\" and \"{}\" contradict each other; give a ramp, a step, points or a file",
                                   outer_.key, first, name));
        }
        first = name;
      }
    }
  }

  void add_point(double time_s, const Number& value, Place place) {
    if (!(time_s >= 0.0 && time_s <= 86'400.0)) {
      source_.fail(place,
                   fmt::format("{}: time {} s of a point is not valid; give one in [0, 86400] s", outer_.key, time_s));
    }
    if (!profile_.points.empty() && time_s < profile_.points.back().first.value) {
      source_.fail(place, fmt::format("{}: time {} s comes after {} s; give the points in the order of time",
                                      outer_.key, time_s, profile_.points.back().first.value));
    }
    profile_.points.emplace_back(seconds(time_s, place), value);
  }

  void read_points(const Entry& entry) {
    const auto* list = entry.node->as_array();
    if (list == nullptr || list->empty()) {
      source_.fail(entry.place, fmt::format("points = {}: give [[time in s, value], ...]", shown(*entry.node)));
    }
    for (const toml::node& node : *list) {
      const Place place = place_of(node.source());
      const auto* pair = node.as_array();
      const bool whole = pair != nullptr && pair->size() == 2 && pair->get(0)->is_number();
      const auto time_s = whole ? pair->get(0)->value<double>() : std::nullopt;
      if (!time_s) source_.fail(place, fmt::format("points holds {}: give [time in s, value]", shown(node)));
      add_point(*time_s, values_.read(*pair->get(1), "a point"), place);
    }
  }

  void read_profile(const Entry& entry, const FileReader& read_file, std::map<std::string, std::string>& files) {
    const std::string name = reader_.text(entry);
    if (name.empty() || name.find('/') != std::string::npos || !name.ends_with(".csv")) {
      source_.fail(entry.place,
                   fmt::format("file = \"{}\": name a .csv file beside the script, without a folder", name));
    }
    if (outer_.field->quantity != Quantity::none && !outer_.has_suffix) {
      source_.fail(entry.place, fmt::format("file = \"{}\": its values have no unit; name it in the key {}{} = ...",
                                            name, outer_.field->facts.key, suffix_of(outer_.field->quantity)));
    }
    const std::optional<std::string> text = read_file(name);
    if (!text) source_.fail(entry.place, fmt::format("file = \"{}\": there is no such file beside the script", name));
    read_rows(name, *text, entry.place);
    files[name] = *text;
  }

  void read_rows(const std::string& name, std::string_view text, Place place) {
    std::size_t row = 0;
    while (!text.empty()) {
      std::string_view line = text.substr(0, text.find('\n'));
      text.remove_prefix(line.size() < text.size() ? line.size() + 1 : text.size());
      if (line.ends_with('\r')) line.remove_suffix(1);
      ++row;
      if (row == 1) {
        if (line != "time_s,value") {
          source_.fail(place, fmt::format("file \"{}\": the first line is wrong; give time_s,value", name));
        }
        continue;
      }
      if (line.empty()) continue;
      const char* end = line.data() + line.size();
      double time_s = 0.0;
      double value = 0.0;
      const auto first = std::from_chars(line.data(), end, time_s);
      const bool comma = first.ec == std::errc() && first.ptr != end && *first.ptr == ',';
      const auto second = comma ? std::from_chars(first.ptr + 1, end, value) : first;
      if (!comma || second.ec != std::errc() || second.ptr != end || !outer_.field->facts.range.contains(value)) {
        source_.fail(place, fmt::format("file \"{}\", line {}: give a time in s and a value in {}", name, row,
                                        outer_.field->facts.range.text()));
      }
      Number number{
          .value = value, .unit = outer_.field->facts.unit, .range = outer_.field->facts.range, .place = place};
      add_point(time_s, number, place);
    }
    if (profile_.points.empty())
      source_.fail(place, fmt::format("file \"{}\" holds no points; give at least one", name));
  }

  const Source& source_;
  const Entry& outer_;
  ValueReader values_;
  TableReader reader_;
  ProfileScript profile_{};
};

}  // namespace

ProfileScript read_profile_script(const Source& source, const Entry& entry, const FileReader& read_file,
                                  std::map<std::string, std::string>& files) {
  if (entry.node->is_table()) return ProfileReader(source, entry).read(read_file, files);
  const Number value = read_number(source, *entry.node, *entry.field, entry.key, entry.has_suffix);
  return {.points = {{seconds(0.0, entry.place), value}}, .place = entry.place};
}

}  // namespace abs_hil::config
