package abs_hil.spy;

/** The last seconds of several quantities over one time axis. A time that goes back starts anew: another run. */
final class SampleHistory {
    private final double windowS;
    private final double[] times;
    private final double[][] values;
    private int first;
    private int size;

    /** Keeps samples of the last {@code windowS} seconds, {@code capacity} of them at most. */
    SampleHistory(int quantities, double windowS, int capacity) {
        if (quantities < 1 || !(windowS > 0) || capacity < 2) {
            throw new IllegalArgumentException("at least 1 quantity, more than 0 s and 2 samples");
        }
        this.windowS = windowS;
        times = new double[capacity];
        values = new double[quantities][capacity];
    }

    /** Takes one sample of each quantity; NaN is a gap. A time already taken, or one that is no number, is ignored. */
    void add(double timeS, double... sample) {
        if (sample.length != values.length) {
            throw new IllegalArgumentException(sample.length + " values for " + values.length + " quantities");
        }
        if (Double.isNaN(timeS) || (size > 0 && timeS == lastTime())) {
            return;
        }
        if (size > 0 && timeS < lastTime()) {
            size = 0;
        }
        if (size == times.length) {
            dropOldest();
        }
        int at = (first + size) % times.length;
        times[at] = timeS;
        for (int quantity = 0; quantity < values.length; ++quantity) {
            values[quantity][at] = sample[quantity];
        }
        ++size;
        while (times[first] < timeS - windowS) {
            dropOldest();
        }
    }

    int size() {
        return size;
    }

    double windowS() {
        return windowS;
    }

    /** Run time of sample {@code i}, s; 0 is the oldest. */
    double time(int i) {
        return times[(first + i) % times.length];
    }

    double value(int quantity, int i) {
        return values[quantity][(first + i) % times.length];
    }

    /** NaN while there are no samples. */
    double lastTime() {
        return size == 0 ? Double.NaN : time(size - 1);
    }

    /** NaN while there are no samples. */
    double lastValue(int quantity) {
        return size == 0 ? Double.NaN : value(quantity, size - 1);
    }

    private void dropOldest() {
        first = (first + 1) % times.length;
        --size;
    }
}
