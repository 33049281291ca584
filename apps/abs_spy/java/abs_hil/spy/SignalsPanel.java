package abs_hil.spy;

import abs_hil.signals_t;
import java.util.function.Supplier;

/** A chart for each of a controller's own signals, sampled from the latest message 50 times a second. */
final class SignalsPanel extends SampledPanel {
    private static final int SIGNALS = 8;

    private final SampleHistory history = new SampleHistory(SIGNALS, WINDOW_S, 1024);
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
        if (!(message instanceof signals_t)) {
            return;
        }
        signals_t s = (signals_t) message;
        if (!names.equals(s.names) || s.stamp_ns < firstNs) {
            begin(s);
        }
        history.add((s.stamp_ns - firstNs) * 1e-9, s.value1, s.value2, s.value3, s.value4, s.value5, s.value6, s.value7,
            s.value8);
    }

    private void begin(signals_t s) {
        names = s.names;
        firstNs = s.stamp_ns;
        removeAll();
        String[] each = names.split(",");
        for (int signal = 0; signal < Math.min(each.length, SIGNALS); ++signal) {
            add(new StripChart(each[signal], history, new int[] {signal}, new String[] {""}, 0.0, 0.0));
        }
        revalidate();
    }

    SampleHistory history() {
        return history;
    }
}
