#include "study/factor.hpp"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace abs_hil::study {

double quantile(const Factor& factor, double u) {
  if (const auto* range = std::get_if<Uniform>(&factor.values)) {
    const double value =
        range->logarithmic ? range->from * std::pow(range->to / range->from, u) : std::lerp(range->from, range->to, u);
    return std::clamp(value, std::min(range->from, range->to), std::max(range->from, range->to));
  }
  const Normal& n = std::get<Normal>(factor.values);
  const boost::math::normal distribution(n.mean, n.sd);
  const double below = boost::math::cdf(distribution, n.least);
  const double within = boost::math::cdf(distribution, n.most) - below;
  const double probability = below + u * within;
  // Rounding may reach an end, whose quantile is infinite.
  if (!(probability > 0.0)) return n.least;
  if (!(probability < 1.0)) return n.most;
  return std::clamp(boost::math::quantile(distribution, probability), n.least, n.most);
}

}  // namespace abs_hil::study
