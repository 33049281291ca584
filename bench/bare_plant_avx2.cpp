// The bare plant of bare_plant.hpp, four runs at once by AVX2.
#define BARE_PLANT_LANES 4
#include "bare_plant.hpp"

bare_plant::Kernel bare_plant::avx2() {
  const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  return {lanes * vectors, has ? brake : nullptr};
}
