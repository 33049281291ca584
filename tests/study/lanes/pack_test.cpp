// Each lane of a pack computes as a double does.
#include "rig/pack.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "abs_hil/rig/tyre_curve.hpp"
#include "catch.hpp"

using namespace abs_hil;

namespace {

using Pack = rig::Pack<rig::Portable, 3>;

std::uint64_t bits_of(double x) { return std::bit_cast<std::uint64_t>(x); }

/// Numbers of every kind, and pairs of equal ones.
std::vector<double> numbers() {
  std::vector<double> all{0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-310, -1e-310, 1e300, 3.0, 3.0};
  all.push_back(std::numeric_limits<double>::quiet_NaN());
  all.push_back(std::numeric_limits<double>::infinity());
  all.push_back(-std::numeric_limits<double>::infinity());
  std::mt19937_64 generator(5);
  std::uniform_real_distribution<double> uniform(-4.0, 4.0);
  while (all.size() < 600) all.push_back(uniform(generator));
  return all;
}

double lane(const Pack& pack, std::size_t n) { return pack.v[n / 2][n % 2]; }
bool lane(const Pack::Mask& mask, std::size_t n) { return mask.m[n / 2][n % 2] != 0; }

Pack pack_of(const std::vector<double>& from, std::size_t first, std::size_t stride) {
  Pack pack(0.0);
  for (std::size_t n = 0; n < Pack::lanes; ++n) pack.v[n / 2][n % 2] = from[(first + n * stride) % from.size()];
  return pack;
}

void check_same(double got, double wanted) {
  if (std::isnan(wanted)) {
    CHECK(std::isnan(got));
  } else {
    CHECK(bits_of(got) == bits_of(wanted));
  }
}

}  // namespace

TEST_CASE("each lane of a pack computes as a double does, bit for bit") {
  const std::vector<double> all = numbers();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Pack a = pack_of(all, i, 1);
    const Pack b = pack_of(all, 7 * i + 3, 5);
    for (std::size_t n = 0; n < Pack::lanes; ++n) {
      const double x = lane(a, n);
      const double y = lane(b, n);
      check_same(lane(Pack(a + b), n), x + y);
      check_same(lane(Pack(a - b), n), x - y);
      check_same(lane(Pack(a * b), n), x * y);
      check_same(lane(Pack(a / b), n), x / y);
      check_same(lane(Pack(-a), n), -x);
      CHECK(lane(a < b, n) == (x < y));
      CHECK(lane(a <= b, n) == (x <= y));
      CHECK(lane(a > b, n) == (x > y));
      CHECK(lane(a >= b, n) == (x >= y));
      CHECK(lane(a == b, n) == (x == y));
      CHECK(lane(a != b, n) == (x != y));
      CHECK(lane(!(a < b) && a == a, n) == (!(x < y) && x == x));
      CHECK(lane(a < b || a != a, n) == (x < y || x != x));
      check_same(lane(rig::select(a < b, a, b), n), rig::select(x < y, x, y));
      check_same(lane(rig::larger(a, b), n), rig::larger(x, y));
      check_same(lane(rig::smaller(a, b), n), rig::smaller(x, y));
      check_same(lane(rig::magnitude(a), n), rig::magnitude(x));
      check_same(lane(rig::with_sign(a, b), n), rig::with_sign(x, y));
      check_same(lane(rig::round_down(a), n), rig::round_down(x));
      check_same(lane(rig::round_up(a), n), rig::round_up(x));
      check_same(lane(rig::square_root(rig::magnitude(a)), n), rig::square_root(rig::magnitude(x)));
      check_same(lane(rig::logarithm(rig::magnitude(a)), n), rig::logarithm(rig::magnitude(x)));
      check_same(lane(rig::power(rig::magnitude(a), Pack(2.1)), n), rig::power(rig::magnitude(x), 2.1));
      check_same(lane(rig::exponential(a), n), rig::exponential(x));
      check_same(lane(rig::exponential_less_one(a), n), rig::exponential_less_one(x));
      check_same(lane(rig::arctangent(a), n), rig::arctangent(x));
      check_same(lane(rig::magic_formula(b, a, Pack(0.3)), n), rig::magic_formula(y, x, 0.3));
      if (std::fabs(x) <= 3.14) check_same(lane(rig::sine(a), n), rig::sine(x));
      if (std::fabs(x) <= 3.14) check_same(lane(rig::cosine(a), n), rig::cosine(x));
    }
  }
}

TEST_CASE("words go into a lane and come back, and the other lanes keep theirs") {
  struct Two {
    Pack a;
    Pack b;
  } packed{Pack(1.0), Pack(2.0)};
  const double words[2]{7.0, 8.0};
  rig::put_lane<Pack>(packed, 4, words);
  for (std::size_t n = 0; n < Pack::lanes; ++n) {
    double out[2]{};
    rig::take_lane<Pack>(packed, n, out);
    CHECK(out[0] == (n == 4 ? 7.0 : 1.0));
    CHECK(out[1] == (n == 4 ? 8.0 : 2.0));
  }
  CHECK(lane_bits(packed.a > Pack(5.0)) == 0b010000);
  CHECK(rig::any(packed.a > Pack(5.0)));
  CHECK_FALSE(rig::any(packed.a > Pack(9.0)));
}
