package abs_hil.spy;

import abs_hil.telemetry_t;
import java.util.Arrays;
import java.util.function.Supplier;

/** A chart for each value of a telemetry message beside its fields, as a controller's own signals, sampled from the latest message 50 times a second. */
final class SignalsPanel extends SampledPanel {
    private static final int MOST = 16;

    private final SampleHistory history = new SampleHistory(MOST, WINDOW_S, 1024);
    private String names = "";
    private long firstNs;

    /** {@code latest} gives the channel's last message, null if there is none yet. */
    SignalsPanel(Supplier<Object> latest) {
        super(latest);
    }

    /** Takes the latest message into the history. Another run may have other signals: then the charts are new. */
    @Override
    void sample() {
        Object message = latest();
        if (!(message instanceof telemetry_t)) {
            return;
        }
        telemetry_t t = (telemetry_t) message;
        if (!names.equals(t.names) || t.stamp_ns < firstNs) {
            begin(t);
        }
        double[] values = new double[MOST];
        Arrays.fill(values, Double.NaN);
        System.arraycopy(t.values, 0, values, 0, Math.min(t.value_count, MOST));
        history.add((t.stamp_ns - firstNs) * 1e-9, values);
    }

    private void begin(telemetry_t t) {
        names = t.names;
        firstNs = t.stamp_ns;
        removeAll();
        String[] each = names.isEmpty() ? new String[0] : names.split(",");
        for (int signal = 0; signal < Math.min(each.length, MOST); ++signal) {
            add(new StripChart(each[signal], history, new int[] {signal}, new String[] {""}, 0.0, 0.0));
        }
        revalidate();
    }

    SampleHistory history() {
        return history;
    }
}
