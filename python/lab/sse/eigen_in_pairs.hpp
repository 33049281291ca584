// Eigen as on Intel's processors, for a processor that is none: it then sums in pairs of doubles as in the program,
// whatever order it would take otherwise, and so to the same bits. SIMDe has the functions that Eigen asks of such a
// processor. Sources of the room `control` get this file before all others.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <climits>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <iosfwd>
#include <limits>
#include <sstream>
#include <type_traits>

#define SIMDE_ENABLE_NATIVE_ALIASES
#include <simde/x86/sse2.h>

#define __SSE2__ 1
// GCC's assembler texts for such a processor are of no use.
#pragma push_macro("__GNUC__")
#undef __GNUC__
#include <Eigen/Dense>
#pragma pop_macro("__GNUC__")
#undef __SSE2__
