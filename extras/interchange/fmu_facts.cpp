// Which variables of a foreign FMU carry which of our quantities, by its description and a mapping file.
#include "interchange/fmu_facts.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <ranges>
#include <set>
#include <span>
#include <type_traits>
#include <utility>

#include "interchange/foreign_controller.hpp"
#include "rig/formatted_text.hpp"
#include "rig/nearest_name.hpp"
#include "rig/parse_toml.hpp"

namespace abs_hil::interchange {

namespace {

namespace fs = std::filesystem;

/// A quantity of ours that a variable of an FMU may carry.
struct CarriedQuantity {
  std::string_view name;
  std::size_t offset;  ///< in abs_hil_input or abs_hil_output
};

/// Takes the quantities of an input or output, for `for_each_input` and `for_each_output`.
template <class Foreign>
auto taken_to(std::vector<CarriedQuantity>& ours, const Foreign& foreign) {
  return [&ours, &foreign](std::string_view name, const double& value, double) {
    const auto offset = reinterpret_cast<const char*>(&value) - reinterpret_cast<const char*>(&foreign);
    ours.push_back({name, static_cast<std::size_t>(offset)});
  };
}

std::vector<CarriedQuantity> our_inputs() {
  std::vector<CarriedQuantity> ours{{"time_s", offsetof(abs_hil_input, time_s)}};
  const abs_hil_input foreign{};
  const control::SlipInput own{};
  for_each_input(foreign, own, taken_to(ours, foreign));
  return ours;
}
std::vector<CarriedQuantity> our_outputs() {
  std::vector<CarriedQuantity> ours;
  const abs_hil_output foreign{};
  const control::SlipOutput own{};
  for_each_output(foreign, own, taken_to(ours, foreign));
  return ours;
}

constexpr FmuType types_of_fmi2[] = {
    {"Real", "Real", 0.0}, {"Integer", "Integer", 0}, {"Boolean", "Boolean", IntFlag{}}, {"Enumeration", "Integer", 0}};
constexpr FmuType types_of_fmi3[] = {{"Float64", "Float64", 0.0},        {"Float32", "Float32", 0.0F},
                                     {"Int8", "Int8", std::int8_t{}},    {"UInt8", "UInt8", std::uint8_t{}},
                                     {"Int16", "Int16", std::int16_t{}}, {"UInt16", "UInt16", std::uint16_t{}},
                                     {"Int32", "Int32", std::int32_t{}}, {"UInt32", "UInt32", std::uint32_t{}},
                                     {"Int64", "Int64", std::int64_t{}}, {"UInt64", "UInt64", std::uint64_t{}},
                                     {"Boolean", "Boolean", false},      {"Enumeration", "Int64", std::int64_t{}}};

struct TheirVariable {
  std::uint32_t reference{0};
  std::string type{};
  std::string causality{};
  bool array{false};
  bool starts{false};  ///< the description has a start value
  std::optional<FmuType> numeric{};
};
using TheirVariables = std::map<std::string, TheirVariable, std::less<>>;

std::uint32_t reference_of(const fs::path& file, pugi::xml_node node) {
  const std::string_view text = node.attribute("valueReference").as_string();
  if (const auto reference = rig::parse_number<std::uint32_t>(text)) return *reference;
  refuse(file, fmt::format("damaged modelDescription.xml: variable \"{}\" has the valueReference \"{}\"; it needs a "
                           "whole number in [0, 4294967295]",
                           node.attribute("name").as_string(), text));
}

TheirVariables variables_of(const fs::path& file, pugi::xml_node root, int fmi) {
  TheirVariables found;
  const std::span<const FmuType> types = fmi == 2 ? std::span<const FmuType>(types_of_fmi2) : types_of_fmi3;
  for (const pugi::xml_node node : root.child("ModelVariables").children()) {
    if (node.type() != pugi::node_element) continue;
    // FMI 2 has the type in an element of the variable, FMI 3 in the variable's own name.
    pugi::xml_node typed = node;
    for (const char* type : {"Real", "Integer", "Boolean", "String", "Enumeration"}) {
      if (fmi == 2 && node.child(type)) typed = node.child(type);
    }
    TheirVariable variable{.reference = reference_of(file, node),
                           .type = typed.name(),
                           .causality = node.attribute("causality").as_string("local"),
                           .array = !node.child("Dimension").empty(),
                           .starts = typed.attribute("start") || typed.child("Start")};
    const auto type = std::ranges::find(types, variable.type, &FmuType::name);
    if (type != types.end()) variable.numeric = *type;
    const std::string name = node.attribute("name").as_string();
    if (!found.emplace(name, std::move(variable)).second) {
      refuse(file, fmt::format("damaged modelDescription.xml: it has two variables \"{}\"", name));
    }
  }
  return found;
}

/// Finds the variables that carry our quantities, by the mapping and by our names, and notes all that does not fit.
class Linker {
 public:
  Linker(const TheirVariables& variables, const fs::path& mapping)
      : variables_(variables), mapping_(mapping.string()) {}

  std::vector<FmuLink> link(const toml::table& names, bool inputs, const std::vector<CarriedQuantity>& ours) {
    const std::string causality = inputs ? "input" : "output";
    const std::string known = fmt::format("{}{}", fmt::join(ours | std::views::transform(&CarriedQuantity::name), ", "),
                                          inputs ? ", start (it keeps its start value)" : "");
    std::vector<FmuLink> links;
    std::set<std::string_view> mapped;
    const auto add = [&](const std::string& place, const std::string& name, const CarriedQuantity& quantity) {
      mapped.insert(quantity.name);
      if (const TheirVariable* variable = their(place, name, causality, quantity.name))
        links.push_back({.reference = variable->reference, .offset = quantity.offset, .type = *variable->numeric});
    };
    for (const auto& [key, node] : names) {
      const std::string name(key.str());
      const auto text = node.value<std::string_view>().value_or("");
      const auto quantity = std::ranges::find(ours, text, &CarriedQuantity::name);
      if (quantity != ours.end()) {
        add(line_of(node), name, *quantity);
      } else if (inputs && text == "start") {
        static_cast<void>(their(line_of(node), name, causality));
      } else {
        problem("{}{}s.\"{}\": give one of {}", line_of(node), causality, name, known);
      }
    }
    std::vector<std::string> unnamed;
    for (const auto& [name, variable] : variables_) {
      if (variable.causality != causality || names.contains(name)) continue;
      const auto quantity = std::ranges::find(ours, name, &CarriedQuantity::name);
      if (quantity != ours.end()) {
        if (inputs || !mapped.contains(name)) add("", name, *quantity);
      } else if (inputs && (variable.numeric || !variable.starts)) {
        unnamed.push_back(name);
      }
    }
    if (!unnamed.empty()) {
      problem(
          "its input{} \"{}\" ha{} no name of ours; write in the table [inputs] of control.foreign.mapping, a TOML "
          "file: \"{}\" = \"start\". In place of start give one of {}",
          unnamed.size() > 1 ? "s" : "", fmt::join(unnamed, "\", \""), unnamed.size() > 1 ? "ve" : "s",
          fmt::join(unnamed, "\" = \"start\", \""), known);
    }
    return links;
  }

  std::vector<FmuLink> parameters(const toml::table& values) {
    std::vector<FmuLink> links;
    for (const auto& [key, node] : values) {
      const TheirVariable* variable =
          their(line_of(node), std::string(key.str()), "parameter", "the table [parameters]");
      if (variable == nullptr) continue;
      const double value = node.value_exact<bool>().value_or(false) ? 1.0 : node.value<double>().value_or(0.0);
      const auto fits = [&node, value]<class Zero>(Zero) {
        if constexpr (std::is_same_v<Zero, bool> || std::is_enum_v<Zero>) {
          return node.is_boolean();
        } else if constexpr (std::is_floating_point_v<Zero>) {
          return node.is_number();
        } else {
          const auto whole = node.is_integer() ? node.value<std::int64_t>() : std::nullopt;
          return whole && std::in_range<Zero>(*whole) && static_cast<double>(*whole) == value;
        }
      };
      if (!std::visit(fits, variable->numeric->zero)) {
        problem("{}parameters.\"{}\": its type is {}; give a value of that", line_of(node), key.str(), variable->type);
      }
      links.push_back({.reference = variable->reference, .wanted = value, .type = *variable->numeric});
    }
    return links;
  }

  template <class... Values>
  void problem(fmt::format_string<Values...> text, Values&&... values) {
    problems_ += (problems_.empty() ? "" : "; ") + fmt::format(text, std::forward<Values>(values)...);
  }
  [[nodiscard]] const std::string& problems() const { return problems_; }

 private:
  std::string line_of(const toml::node& node) const {
    return fmt::format("{}, line {}: ", mapping_, node.source().begin.line);
  }
  /// The variable, if it is there and of that causality, and a number if somebody needs one.
  const TheirVariable* their(const std::string& place, const std::string& name, std::string_view causality,
                             std::string_view needs_number = {}) {
    const auto at = variables_.find(name);
    if (at == variables_.end()) {
      problem("{}it has no variable \"{}\"{}", place, name, rig::nearest_hint(name, variables_ | std::views::keys));
      return nullptr;
    }
    const TheirVariable& variable = at->second;
    const bool fits = variable.causality == causality;
    if (!fits)
      problem("{}its variable \"{}\" has causality {}; give an {}", place, name, variable.causality, causality);
    if (!fits || needs_number.empty() || (variable.numeric && !variable.array)) return fits ? &variable : nullptr;
    problem("{}its variable \"{}\" {} {}; {} needs a single number", place, name,
            variable.array ? "is an array of type" : "has type", variable.type, needs_number);
    return nullptr;
  }

  const TheirVariables& variables_;
  std::string mapping_;
  std::string problems_{};
};

toml::table read_mapping(const fs::path& mapping) {
  if (mapping.empty()) return {};
  try {
    std::ifstream in(mapping, std::ios::binary);
    if (!in) refuse(mapping, "cannot be read; give control.foreign.mapping a TOML file");
    toml::table table = rig::parse_toml(in, mapping.string());
    for (const auto& [key, node] : table) {
      const bool known = key == "inputs" || key == "outputs" || key == "parameters";
      if (!known || !node.is_table())
        refuse(mapping, fmt::format("{}: give the tables inputs, outputs, parameters", key.str()));
    }
    return table;
  } catch (const toml::parse_error& error) {
    refuse(mapping, fmt::format("line {}: {}", error.source().begin.line, error.description()));
  }
}

}  // namespace

FmuFacts facts_of(const fs::path& file, const fs::path& folder, const fs::path& mapping) {
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_file((folder / "modelDescription.xml").c_str());
  if (!parsed) refuse(file, fmt::format("damaged modelDescription.xml: {}", parsed.description()));
  const pugi::xml_node root = document.child("fmiModelDescription");
  const std::string version = root.attribute("fmiVersion").as_string();
  FmuFacts facts{.fmi = version.starts_with("3.") ? 3 : 2};
  if (!version.starts_with("2.") && !version.starts_with("3.")) {
    refuse(file, fmt::format("its FMI version is \"{}\"; export it for FMI 2.0 or 3.0", version));
  }
  const pugi::xml_node simulation = root.child("CoSimulation");
  if (!simulation)
    refuse(file, "it is not for co-simulation (model exchange only, perhaps); export it for co-simulation");
  if (simulation.attribute("needsExecutionTool").as_bool()) {
    refuse(file, "it needs the tool that made it; export it as a self-contained FMU");
  }
  facts.token = root.attribute(facts.fmi == 3 ? "instantiationToken" : "guid").as_string();
  const std::string identifier = simulation.attribute("modelIdentifier").as_string();
  facts.library = folder / "binaries" / (facts.fmi == 3 ? "x86_64-linux" : "linux64") / (identifier + ".so");
  if (identifier.empty() || identifier.find('/') != std::string::npos || !fs::is_regular_file(facts.library)) {
    refuse(file, fmt::format("it has no {}, the library that its description names",
                             fs::relative(facts.library, folder).string()));
  }
  const TheirVariables variables = variables_of(file, root, facts.fmi);
  const toml::table names = read_mapping(mapping);
  Linker linker(variables, mapping);
  const toml::table none;
  const auto table = [&](const char* name) -> const toml::table& {  // a copy would not know its lines
    return names[name].is_table() ? *names[name].as_table() : none;
  };
  facts.inputs = linker.link(table("inputs"), true, our_inputs());
  facts.outputs = linker.link(table("outputs"), false, our_outputs());
  facts.parameters = linker.parameters(table("parameters"));
  const auto is_torque = [](const FmuLink& out) { return out.offset == offsetof(abs_hil_output, brake_torque_Nm); };
  if (std::ranges::none_of(facts.outputs, is_torque)) {
    const auto is_output = [](const auto& variable) { return variable.second.causality == "output"; };
    linker.problem(
        "it has no output brake_torque_Nm; name the one that is (of \"{}\") in the table [outputs] of "
        "control.foreign.mapping: \"NAME\" = \"brake_torque_Nm\"",
        fmt::join(variables | std::views::filter(is_output) | std::views::keys, "\", \""));
  }
  if (linker.problems().empty() && facts.inputs.empty()) {
    linker.problem("none of its inputs has a name of ours (docs/interchange.md); name them in control.foreign.mapping");
  }
  if (!linker.problems().empty()) refuse(file, linker.problems());
  return facts;
}

}  // namespace abs_hil::interchange
