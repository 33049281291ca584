#include "truth_file.hpp"

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace abs_hil::app {

void open_for_writing(std::ofstream& stream, const std::string& file) {
  stream.close();
  stream.open(file);
  if (!stream) throw std::runtime_error(file + ": cannot be written: " + std::strerror(errno));
}

}  // namespace abs_hil::app
