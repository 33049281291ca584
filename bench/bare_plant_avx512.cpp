// The bare plant of bare_plant.hpp, eight runs at once by AVX-512.
#define BARE_PLANT_LANES 8
#include "bare_plant.hpp"

bare_plant::Kernel bare_plant::avx512() {
  const bool has = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0;
  return {lanes * vectors, has ? brake : nullptr};
}
