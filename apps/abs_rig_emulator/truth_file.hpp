#pragma once

#include <fstream>
#include <string>

namespace abs_hil::app {

/// Opens a file that the emulator writes aside, truth or traffic. Throws std::runtime_error.
void open_for_writing(std::ofstream& stream, const std::string& file);

}  // namespace abs_hil::app
