package abs_hil.spy;

/** Bounds of a chart's axis on round numbers, and the step between its marks. */
final class AxisRange {
    final double low;
    final double high;
    final double step;

    /** Holds everything between {@code low} and {@code high}, with {@code marks} steps or fewer (2 or more). */
    AxisRange(double low, double high, int marks) {
        double span = high > low ? high - low : 1.0;
        step = roundStep(span / Math.max(2, marks - 1));
        this.low = Math.floor(low / step + 1e-9) * step;
        this.high = Math.max(Math.ceil(high / step - 1e-9) * step, this.low + step);
    }

    /** The smallest of 1, 2, 5, 10, 20, 50 ... that is no less than {@code least}. */
    static double roundStep(double least) {
        double power = Math.pow(10.0, Math.floor(Math.log10(least)));
        for (double factor : new double[] {1.0, 2.0, 5.0}) {
            if (factor * power >= least * (1 - 1e-12)) {
                return factor * power;
            }
        }
        return 10.0 * power;
    }

    /** Where {@code value} lies, 0 at the lower bound and 1 at the upper. */
    double fraction(double value) {
        return (value - low) / (high - low);
    }
}
