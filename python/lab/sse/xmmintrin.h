// Empty, in place of the compiler's own: SIMDe has these functions, see eigen_in_pairs.hpp.
