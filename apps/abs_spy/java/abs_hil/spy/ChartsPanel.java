package abs_hil.spy;

import abs_hil.telemetry_t;
import java.util.function.Supplier;

/** Slip, speeds and theta of a telemetry channel, sampled from the latest message 50 times a second. */
final class ChartsPanel extends SampledPanel {
    private static final int SLIP = 0;
    private static final int SLIP_REF = 1;
    private static final int OMEGA1 = 2;
    private static final int OMEGA2 = 3;
    private static final int THETA_EST = 4;
    private static final int THETA = 5;
    private static final int QUANTITIES = 6;

    private final SampleHistory history = new SampleHistory(QUANTITIES, WINDOW_S, 1024);

    /** {@code latest} gives the channel's last message, null if there is none yet. */
    ChartsPanel(Supplier<Object> latest) {
        super(latest);
        add(chart("slip", new int[] {SLIP, SLIP_REF}, new String[] {"slip", "wanted"}, 0.0, 1.0));
        add(chart("speeds, rad/s", new int[] {OMEGA1, OMEGA2}, new String[] {"upper wheel", "lower wheel"}, 0.0, 50.0));
        add(chart("peak tyre force, N", new int[] {THETA_EST, THETA}, new String[] {"\u03b8\u0302", "\u03b8"}, 0.0, 10.0));
    }

    private StripChart chart(String title, int[] quantities, String[] names, double leastLow, double leastHigh) {
        return new StripChart(title, history, quantities, names, leastLow, leastHigh);
    }

    /** Takes the latest message into the history. Speeds and slip are the truth where it is known, else estimates. */
    @Override
    void sample() {
        Object message = latest();
        if (!(message instanceof telemetry_t)) {
            return;
        }
        telemetry_t t = (telemetry_t) message;
        // Slip is no number where nothing rolls, and its quotient goes beyond all bounds just before that.
        double slip = known(t.slip, t.slip_est);
        history.add(t.time_s, slip < -1.0 ? Double.NaN : slip, t.slip_ref, known(t.omega1_rad_s, t.omega1_est_rad_s),
            known(t.omega2_rad_s, t.omega2_est_rad_s), t.theta_est_N, t.theta_N);
    }

    SampleHistory history() {
        return history;
    }

    private static double known(double truth, double estimate) {
        return Double.isNaN(truth) ? estimate : truth;
    }
}
