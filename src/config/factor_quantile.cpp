// The value of a factor at a probability (config/factors.cpp has the formulas). It stands apart because Boost computes
// tables of the normal distribution as a program starts: only programs that draw from factors link them.
#include <algorithm>
#include <boost/math/distributions/normal.hpp>

#include "config/script.hpp"

namespace abs_hil::config {

double quantile(const Factor& factor, double u) {
  if (const auto* range = std::get_if<Uniform>(&factor.values)) return at(*range, u);
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

}  // namespace abs_hil::config
