#pragma once

#include <filesystem>
#include <string>

#include "interchange/fmu/model.hpp"

namespace abs_hil::interchange {

/// What an exported FMU is called and describes.
struct FmuExport {
  std::string kind{};                ///< fmu::plant_kind or fmu::controller_kind
  std::string name{};                ///< of the model, such as "abs_hil plant paper-table1"
  std::string version{};             ///< of this program
  int fmi{2};                        ///< 2 or 3
  double step_s{1e-3};               ///< the communication step: the control period
  std::filesystem::path binaries{};  ///< folder with linux64/abs_hil_fmu.so and, if built, win64/abs_hil_fmu.dll
};

/// modelDescription.xml of the model, whose present parameters are the start values.
[[nodiscard]] std::string model_description(const FmuExport& what, const fmu::Model& model);

/// Writes the FMU, complete or not at all. Returns the platforms that it works on. Throws std::runtime_error, which
/// names the file and the fix.
std::string write_fmu(const FmuExport& what, const fmu::Model& model, const std::filesystem::path& path);

/// The folder of the FMUs' binaries: beside the running program, or of the installation.
[[nodiscard]] std::filesystem::path fmu_binaries();

}  // namespace abs_hil::interchange
