// Which variables of a foreign FMU carry which of our quantities, by its description and a mapping file.
#include "interchange/fmu_facts.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <pugixml.hpp>
#include <ranges>
#include <set>

#include "interchange/foreign_controller.hpp"
#include "rig/formatted_text.hpp"
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

struct TheirVariable {
  std::uint32_t reference{0};
  std::string type{};
  std::string causality{};
};
using TheirVariables = std::map<std::string, TheirVariable, std::less<>>;

bool is_real(const TheirVariable& variable) { return variable.type == "Real" || variable.type == "Float64"; }

std::uint32_t reference_of(const fs::path& file, pugi::xml_node node) {
  const std::string_view text = node.attribute("valueReference").as_string();
  if (const auto reference = rig::parse_number<std::uint32_t>(text)) return *reference;
  refuse(file, fmt::format("damaged modelDescription.xml: variable \"{}\" has the valueReference \"{}\"; it needs a "
                           "whole number in [0, 4294967295]",
                           node.attribute("name").as_string(), text));
}

TheirVariables variables_of(const fs::path& file, pugi::xml_node root, int fmi) {
  TheirVariables found;
  for (const pugi::xml_node node : root.child("ModelVariables").children()) {
    if (node.type() != pugi::node_element) continue;
    TheirVariable variable{.reference = reference_of(file, node),
                           .type = node.name(),
                           .causality = node.attribute("causality").as_string("local")};
    if (fmi == 2) {
      for (const char* type : {"Real", "Integer", "Boolean", "String", "Enumeration"}) {
        if (node.child(type)) variable.type = type;
      }
    }
    const std::string name = node.attribute("name").as_string();
    if (!found.emplace(name, std::move(variable)).second) {
      refuse(file, fmt::format("damaged modelDescription.xml: it has two variables \"{}\"", name));
    }
  }
  return found;
}

const TheirVariable& their(const fs::path& file, const TheirVariables& variables, const std::string& name,
                           const std::string& causality) {
  const auto at = variables.find(name);
  if (at == variables.end())
    refuse(file, fmt::format("it has no variable \"{}\", which control.foreign.mapping names", name));
  if (at->second.causality != causality) {
    refuse(file,
           fmt::format("its variable \"{}\" has causality {}; give an {}", name, at->second.causality, causality));
  }
  return at->second;
}

void link(const fs::path& file, const TheirVariables& variables, const toml::table* names, const char* causality,
          const std::vector<CarriedQuantity>& ours, std::vector<FmuLink>& links) {
  const auto add = [&](const std::string& name, const CarriedQuantity& quantity) {
    const TheirVariable& variable = their(file, variables, name, causality);
    if (!is_real(variable)) {
      refuse(file, fmt::format("its variable \"{}\" has type {}; {} needs a real number", name, variable.type,
                               quantity.name));
    }
    links.push_back({.reference = variable.reference, .offset = quantity.offset});
  };
  const auto find = [&](std::string_view name) { return std::ranges::find(ours, name, &CarriedQuantity::name); };
  const bool inputs = std::string_view(causality) == "input";
  const auto known = [&] {
    return fmt::format("{}{}", fmt::join(ours | std::views::transform(&CarriedQuantity::name), ", "),
                       inputs ? ", start (it keeps its start value)" : "");
  };
  std::set<std::string_view> named;
  if (names != nullptr) {
    for (const auto& [key, node] : *names) {
      const std::string name(key.str());
      const auto text = node.value<std::string_view>().value_or("");
      if (inputs && text == "start") {
        static_cast<void>(their(file, variables, name, causality));
        continue;
      }
      const auto quantity = find(text);
      if (quantity == ours.end()) {
        refuse(file, fmt::format("control.foreign.mapping: {}s.\"{}\": give one of {}", causality, name, known()));
      }
      add(name, *quantity);
      named.insert(quantity->name);
    }
  }
  for (const auto& [name, variable] : variables) {
    if (variable.causality != causality || (names != nullptr && names->contains(name))) continue;
    const auto quantity = find(name);
    if (inputs && quantity == ours.end()) {
      refuse(file, fmt::format("its input \"{}\" has no name of ours; give it one of {} in the table [inputs] of "
                               "control.foreign.mapping",
                               name, known()));
    }
    if (quantity != ours.end() && (inputs || !named.contains(name))) add(name, *quantity);
  }
}

void set_parameters(const fs::path& file, const TheirVariables& variables, const toml::table& values, FmuFacts& facts) {
  for (const auto& [key, node] : values) {
    const std::string name(key.str());
    const TheirVariable& variable = their(file, variables, name, "parameter");
    const auto number = node.value<double>();
    const auto flag = node.value<bool>();
    FmuLink link{.reference = variable.reference};
    if (is_real(variable) && number) {
      link.value = *number;
      facts.parameters.push_back(link);
    } else if (variable.type == "Boolean" && node.is_boolean()) {
      link.value = *flag ? 1.0 : 0.0;
      facts.flags.push_back(link);
    } else if ((variable.type == "Integer" || variable.type == "Int32") && node.is_integer()) {
      link.value = *number;
      facts.integers.push_back(link);
    } else {
      refuse(file,
             fmt::format("control.foreign.mapping: parameters.\"{}\": its type is {}; give a number or true or false",
                         name, variable.type));
    }
  }
}

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
  link(file, variables, names["inputs"].as_table(), "input", our_inputs(), facts.inputs);
  link(file, variables, names["outputs"].as_table(), "output", our_outputs(), facts.outputs);
  if (const toml::table* values = names["parameters"].as_table()) set_parameters(file, variables, *values, facts);
  const bool torque = std::any_of(facts.outputs.begin(), facts.outputs.end(), [](const FmuLink& out) {
    return out.offset == offsetof(abs_hil_output, brake_torque_Nm);
  });
  if (!torque) {
    refuse(file,
           "it has no output brake_torque_Nm; name the one that is, in the table [outputs] of control.foreign.mapping");
  }
  if (facts.inputs.empty()) {
    refuse(file, "none of its inputs has a name of ours (docs/interchange.md); name them in control.foreign.mapping");
  }
  return facts;
}

}  // namespace abs_hil::interchange
