#pragma once

/// The instruction sets that packs are compiled for (rig/pack.hpp), for sources that only choose between them.
namespace abs_hil::rig {
struct Portable;
struct Avx2;
struct Avx512;
}  // namespace abs_hil::rig
