package abs_hil.spy;

import abs_hil.signals_t;
import java.awt.GridLayout;
import java.util.function.Supplier;
import javax.swing.JPanel;
import javax.swing.Timer;

/** A chart for each of a controller's own signals, sampled from the latest message 50 times a second. */
final class SignalsPanel extends JPanel {
    private static final double WINDOW_S = 10.0;
    private static final int PERIOD_MS = 20;
    private static final int SAMPLES_PER_PAINT = 5;
    private static final int SIGNALS = 8;

    private final SampleHistory history = new SampleHistory(SIGNALS, WINDOW_S, 1024);
    private final transient Supplier<Object> latest;
    private final Timer timer = new Timer(PERIOD_MS, event -> tick());
    private String names = "";
    private long firstNs;
    private int ticks;

    /** {@code latest} gives the channel's last message, null if there is none yet. */
    SignalsPanel(Supplier<Object> latest) {
        super(new GridLayout(0, 1));
        this.latest = latest;
    }

    /** Painting takes longer than sampling, so it is done less often. */
    private void tick() {
        sample();
        if (++ticks % SAMPLES_PER_PAINT == 0) {
            repaint();
        }
    }

    /** Takes the latest message into the history. Another run may have other signals: then the charts are new. */
    void sample() {
        Object message = latest.get();
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

    @Override
    public void addNotify() {
        super.addNotify();
        timer.start();
    }

    @Override
    public void removeNotify() {
        timer.stop();
        super.removeNotify();
    }
}
