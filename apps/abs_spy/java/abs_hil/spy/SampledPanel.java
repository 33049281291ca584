package abs_hil.spy;

import java.awt.GridLayout;
import java.util.function.Supplier;
import javax.swing.JPanel;
import javax.swing.Timer;

/** Charts below one another, sampled from a channel's latest message 50 times a second while they are shown. */
abstract class SampledPanel extends JPanel {
    static final double WINDOW_S = 10.0;
    private static final int PERIOD_MS = 20;
    private static final int SAMPLES_PER_PAINT = 5;

    private final transient Supplier<Object> latest;
    private final Timer timer = new Timer(PERIOD_MS, event -> tick());
    private int ticks;

    /** {@code latest} gives the channel's last message, null if there is none yet. */
    SampledPanel(Supplier<Object> latest) {
        super(new GridLayout(0, 1));
        this.latest = latest;
    }

    /** Takes the latest message into the history. */
    abstract void sample();

    final Object latest() {
        return latest.get();
    }

    /** Painting takes longer than sampling, so it is done less often. */
    private void tick() {
        sample();
        if (++ticks % SAMPLES_PER_PAINT == 0) {
            repaint();
        }
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
