#include "interchange/export.hpp"

#include <fmt/format.h>
#include <zip.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <memory>
#include <pugixml.hpp>
#include <sstream>
#include <stdexcept>
#include <type_traits>

#include "files/result_file.hpp"

namespace abs_hil::interchange {

namespace {

namespace fs = std::filesystem;
using fmu::Causality;
using fmu::Variable;

/// The name of the binary's file, without ending: the same for both kinds.
constexpr const char* identifier = "abs_hil_fmu";

struct Platform {
  const char* source;
  const char* fmi2;
  const char* fmi3;
};
constexpr std::array platforms{
    Platform{"linux64/abs_hil_fmu.so", "binaries/linux64/abs_hil_fmu.so", "binaries/x86_64-linux/abs_hil_fmu.so"},
    Platform{"win64/abs_hil_fmu.dll", "binaries/win64/abs_hil_fmu.dll", "binaries/x86_64-windows/abs_hil_fmu.dll"}};

/// Exponents of the base units of a unit of ours; units of two versions of the interface are the same.
struct BaseUnit {
  int kg{0};
  int m{0};
  int s{0};
  int rad{0};
  double factor{1.0};
};
/// Units that tools may convert. Others are texts to them.
const std::map<std::string_view, BaseUnit>& base_units() {
  static const std::map<std::string_view, BaseUnit> units{{"m", {.m = 1}},
                                                          {"s", {.s = 1}},
                                                          {"1/s", {.s = -1}},
                                                          {"1/s^2", {.s = -2}},
                                                          {"1/s^3", {.s = -3}},
                                                          {"Hz", {.s = -1}},
                                                          {"m/s", {.m = 1, .s = -1}},
                                                          {"m/s^2", {.m = 1, .s = -2}},
                                                          {"m/s^3", {.m = 1, .s = -3}},
                                                          {"rad/s", {.s = -1, .rad = 1}},
                                                          {"rad", {.rad = 1}},
                                                          {"deg", {.rad = 1, .factor = 0.017453292519943295}},
                                                          {"N", {.kg = 1, .m = 1, .s = -2}},
                                                          {"N m", {.kg = 1, .m = 2, .s = -2}},
                                                          {"N m/s", {.kg = 1, .m = 2, .s = -3}},
                                                          {"N m s", {.kg = 1, .m = 2, .s = -1}},
                                                          {"kg m^2", {.kg = 1, .m = 2}},
                                                          {"kg^2/s^2", {.kg = 2, .s = -2}}};
  return units;
}

void add_units(pugi::xml_node root, const fmu::Model& model) {
  std::map<std::string, BaseUnit> used;
  for (const Variable& variable : model.variables()) {
    if (variable.facts.unit.empty() || !std::holds_alternative<double*>(variable.value)) continue;
    const auto known = base_units().find(variable.facts.unit);
    used.emplace(variable.facts.unit, known == base_units().end() ? BaseUnit{.factor = 0.0} : known->second);
  }
  pugi::xml_node list = root.append_child("UnitDefinitions");
  for (const auto& [name, unit] : used) {
    pugi::xml_node node = list.append_child("Unit");
    node.append_attribute("name") = name.c_str();
    if (unit.factor == 0.0) continue;
    pugi::xml_node base = node.append_child("BaseUnit");
    for (const auto& [symbol, exponent] : {std::pair{"kg", unit.kg}, {"m", unit.m}, {"s", unit.s}, {"rad", unit.rad}}) {
      if (exponent != 0) base.append_attribute(symbol) = exponent;
    }
    if (unit.factor != 1.0) base.append_attribute("factor") = unit.factor;
  }
}

const char* type_name(const Variable& variable, int fmi) {
  constexpr std::array<std::array<const char*, 2>, 5> names{
      {{"Real", "Float64"}, {"Integer", "Int32"}, {"", ""}, {"Boolean", "Boolean"}, {"String", "String"}}};
  return names.at(variable.value.index()).at(fmi == 3 ? 1 : 0);
}

const char* causality_name(Causality causality) {
  constexpr std::array names{"parameter", "input", "output"};
  return names.at(static_cast<std::size_t>(causality));
}

/// Bounds of an interval without its open ends: FMI knows closed intervals only. The binary checks the open ends.
void add_bounds(pugi::xml_node node, const rig::Range& range, bool whole) {
  if (!(range.least < range.most)) return;
  const auto text = [whole](double value) {
    return whole ? fmt::format("{}", static_cast<std::int64_t>(value)) : fmt::format("{}", value);
  };
  node.append_attribute("min") = text(range.least).c_str();
  node.append_attribute("max") = text(range.most).c_str();
}

/// The attributes of the type's own element (FMI 2) or of the variable's (FMI 3).
void add_type_attributes(pugi::xml_node node, const Variable& variable, int fmi) {
  const bool number = variable.value.index() < 2;
  if (std::holds_alternative<double*>(variable.value) && !variable.facts.unit.empty()) {
    node.append_attribute("unit") = std::string(variable.facts.unit).c_str();
  }
  if (number) add_bounds(node, variable.facts.range, variable.value.index() == 1);
  if (variable.causality == Causality::output) return;
  const std::string start = fmu::text_of(variable);
  if (fmi == 3 && std::holds_alternative<std::string*>(variable.value)) {
    node.append_child("Start").append_attribute("value") = start.c_str();
  } else {
    node.append_attribute("start") = start.c_str();
  }
}

void add_variables(pugi::xml_node root, const fmu::Model& model, int fmi) {
  pugi::xml_node list = root.append_child("ModelVariables");
  if (fmi == 3) {
    pugi::xml_node time = list.append_child("Float64");
    time.append_attribute("name") = "time";
    time.append_attribute("valueReference") = 0;
    time.append_attribute("causality") = "independent";
    time.append_attribute("variability") = "continuous";
    time.append_attribute("unit") = "s";
  }
  unsigned reference = 1;
  for (const Variable& variable : model.variables()) {
    pugi::xml_node node = list.append_child(fmi == 3 ? type_name(variable, fmi) : "ScalarVariable");
    node.append_attribute("name") = variable.name.c_str();
    node.append_attribute("valueReference") = reference++;
    std::string meaning(variable.facts.meaning);
    for (const std::string_view name : variable.facts.allowed.list()) {
      meaning.append(name == variable.facts.allowed.at(0) ? ": one of " : ", ").append(name);
    }
    node.append_attribute("description") = meaning.c_str();
    node.append_attribute("causality") = causality_name(variable.causality);
    const bool continuous =
        std::holds_alternative<double*>(variable.value) && variable.causality != Causality::parameter;
    node.append_attribute("variability") =
        variable.causality == Causality::parameter ? "fixed" : (continuous ? "continuous" : "discrete");
    if (fmi == 2) {
      if (variable.causality == Causality::output) node.append_attribute("initial") = "calculated";
      add_type_attributes(node.append_child(type_name(variable, fmi)), variable, fmi);
    } else {
      add_type_attributes(node, variable, fmi);
    }
  }
}

/// Outputs depend on states only; the structure names them once for each use.
void add_structure(pugi::xml_node root, const fmu::Model& model, int fmi) {
  pugi::xml_node structure = root.append_child("ModelStructure");
  std::vector<unsigned> outputs;
  for (unsigned n = 0; n < model.variables().size(); ++n) {
    if (model.variables()[n].causality == Causality::output) outputs.push_back(n + 1);
  }
  if (fmi == 3) {
    for (const char* element : {"Output", "InitialUnknown"}) {
      for (const unsigned reference : outputs) {
        structure.append_child(element).append_attribute("valueReference") = reference;
      }
    }
    return;
  }
  for (const char* element : {"Outputs", "InitialUnknowns"}) {
    pugi::xml_node list = structure.append_child(element);
    for (const unsigned index : outputs) list.append_child("Unknown").append_attribute("index") = index;
  }
}

std::string start_values(const fmu::Model& model) {
  std::string text;
  for (const Variable& variable : model.variables()) {
    if (variable.causality == Causality::parameter) text += variable.name + '=' + fmu::text_of(variable) + '\n';
  }
  return text;
}

/// A zip archive that is discarded unless `close` succeeds.
class Archive {
 public:
  Archive() {
    zip_source_keep(content_.get());  // the archive frees it too
    archive_.reset(zip_open_from_source(content_.get(), ZIP_TRUNCATE, nullptr));
    if (archive_) return;
    zip_source_free(content_.get());
    fail("no memory");
  }
  /// @param text  must live until `close`
  void add(const std::string& name, const std::string& text) {
    add(name, zip_source_buffer(archive_.get(), text.data(), text.size(), 0));
  }
  void add_file(const std::string& name, const fs::path& file) {
    add(name, zip_source_file(archive_.get(), file.c_str(), 0, -1));
  }
  /// The bytes of the archive, once.
  [[nodiscard]] std::string close() {
    zip_t* archive = archive_.release();
    if (zip_close(archive) != 0) {
      const std::string text = zip_strerror(archive);
      zip_discard(archive);
      fail(text);
    }
    zip_stat_t facts;
    if (zip_source_stat(content_.get(), &facts) != 0 || zip_source_open(content_.get()) != 0) fail("cannot be read");
    std::string bytes(facts.size, '\0');
    const zip_int64_t read = zip_source_read(content_.get(), bytes.data(), bytes.size());
    zip_source_close(content_.get());
    if (read != static_cast<zip_int64_t>(bytes.size())) fail("cannot be read");
    return bytes;
  }

 private:
  [[noreturn]] static void fail(const std::string& why) { throw std::runtime_error("the FMU's archive: " + why); }
  void add(const std::string& name, zip_source_t* source) {
    if (source != nullptr && zip_file_add(archive_.get(), name.c_str(), source, ZIP_FL_ENC_UTF_8) >= 0) return;
    if (source != nullptr) zip_source_free(source);
    throw std::runtime_error(fmt::format("{}: {}", name, zip_strerror(archive_.get())));
  }
  std::unique_ptr<zip_source_t, decltype(&zip_source_free)> content_{zip_source_buffer_create(nullptr, 0, 0, nullptr),
                                                                     zip_source_free};
  std::unique_ptr<zip_t, decltype(&zip_discard)> archive_{nullptr, zip_discard};
};

}  // namespace

std::string model_description(const FmuExport& what, const fmu::Model& model) {
  pugi::xml_document document;
  pugi::xml_node declaration = document.append_child(pugi::node_declaration);
  declaration.append_attribute("version") = "1.0";
  declaration.append_attribute("encoding") = "UTF-8";
  pugi::xml_node root = document.append_child("fmiModelDescription");
  root.append_attribute("fmiVersion") = what.fmi == 3 ? "3.0" : "2.0";
  root.append_attribute("modelName") = what.name.c_str();
  root.append_attribute(what.fmi == 3 ? "instantiationToken" : "guid") = fmu::token_of(what.kind, model).c_str();
  root.append_attribute("generationTool") = ("abs_hil " + what.version).c_str();
  root.append_attribute("variableNamingConvention") = "flat";
  pugi::xml_node simulation = root.append_child("CoSimulation");
  simulation.append_attribute("modelIdentifier") = identifier;
  simulation.append_attribute("canHandleVariableCommunicationStepSize") = what.kind == fmu::plant_kind;
  simulation.append_attribute(what.fmi == 3 ? "canGetAndSetFMUState" : "canGetAndSetFMUstate") = true;
  simulation.append_attribute(what.fmi == 3 ? "canSerializeFMUState" : "canSerializeFMUstate") = true;
  if (what.fmi == 3) simulation.append_attribute("fixedInternalStepSize") = what.step_s;
  add_units(root, model);
  if (what.fmi == 3) {
    pugi::xml_node unit = root.child("UnitDefinitions");
    if (!unit.find_child_by_attribute("Unit", "name", "s")) {
      pugi::xml_node seconds = unit.append_child("Unit");
      seconds.append_attribute("name") = "s";
      seconds.append_child("BaseUnit").append_attribute("s") = 1;
    }
  }
  pugi::xml_node categories = root.append_child("LogCategories");
  for (const char* name : {"logStatusError", "logAll"})
    categories.append_child("Category").append_attribute("name") = name;
  pugi::xml_node experiment = root.append_child("DefaultExperiment");
  experiment.append_attribute("startTime") = 0;
  experiment.append_attribute("stopTime") = 3;
  experiment.append_attribute("stepSize") = what.step_s;
  add_variables(root, model, what.fmi);
  add_structure(root, model, what.fmi);
  std::ostringstream text;
  document.save(text, "  ");
  return text.str();
}

std::string write_fmu(const FmuExport& what, const fmu::Model& model, const fs::path& path) {
  const std::string description = model_description(what, model);
  const std::string start = start_values(model);
  files::ResultFile file(path, "FMU");
  std::string names;
  Archive archive;
  archive.add("modelDescription.xml", description);
  archive.add("resources/start.txt", start);
  for (const Platform& platform : platforms) {
    const fs::path binary = what.binaries / platform.source;
    if (!fs::exists(binary)) continue;
    archive.add_file(what.fmi == 3 ? platform.fmi3 : platform.fmi2, binary);
    names += (names.empty() ? "" : ", ") + binary.parent_path().filename().string();
  }
  if (names.empty()) {
    throw std::runtime_error(
        fmt::format("\"{}\" holds no binary for FMUs; build the target abs_hil_fmu, or install "
                    "abs_hil again",
                    what.binaries.string()));
  }
  file.write(archive.close());
  return names;
}

fs::path fmu_binaries() {
  std::error_code error;
  const fs::path bin = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const fs::path& folder : {bin.parent_path() / "fmu", bin.parent_path() / ABS_HIL_HOST_DIR / "fmu"}) {
    if (fs::exists(folder, error)) return folder;
  }
  return fs::path(ABS_HIL_INSTALLED_HOST_DIR) / "fmu";
}

}  // namespace abs_hil::interchange
