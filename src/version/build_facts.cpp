// The only source that a commit changes: everything else is linked again, not compiled again.
#include "version/build_facts.hpp"

#include "abs_hil_revision.hpp"

namespace abs_hil::version {

BuildFacts build_facts() {
#ifdef __clang__
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "gcc " __VERSION__;
#endif
  return {ABS_HIL_VERSION, ABS_HIL_REVISION, ABS_HIL_BUILD_TYPE, compiler};
}

std::string version_line(const std::string& program) {
  const std::string revision = ABS_HIL_REVISION;
  return program + " " ABS_HIL_VERSION + (revision == "unknown" ? "" : " (" + revision + ")");
}

}  // namespace abs_hil::version
