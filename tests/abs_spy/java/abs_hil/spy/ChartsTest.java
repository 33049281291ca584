package abs_hil.spy;

import abs_hil.telemetry_t;
import java.awt.image.BufferedImage;
import javax.swing.JTable;
import javax.swing.table.DefaultTableModel;

/** The charts without a screen. Prints each case; throws at the first that fails. */
public final class ChartsTest {
    private static void check(boolean holds, String what) {
        if (!holds) {
            throw new AssertionError(what);
        }
    }

    private static void historyKeepsItsWindow() {
        SampleHistory history = new SampleHistory(2, 1.0, 1000);
        for (int i = 0; i <= 300; ++i) {
            history.add(i / 100.0, i, -i);
        }
        check(history.size() == 101, "101 samples of 10 ms in 1 s, not " + history.size());
        check(history.time(0) == 2.0 && history.value(0, 0) == 200 && history.value(1, 0) == -200, "oldest");
        check(history.lastTime() == 3.0 && history.lastValue(0) == 300, "latest");
    }

    private static void historyNeverOutgrowsItsCapacity() {
        SampleHistory history = new SampleHistory(1, 1000.0, 4);
        for (int i = 0; i < 10; ++i) {
            history.add(i, i);
        }
        check(history.size() == 4 && history.value(0, 0) == 6 && history.lastValue(0) == 9, "the last four");
    }

    private static void historyStartsAnewWithAnotherRun() {
        SampleHistory history = new SampleHistory(1, 10.0, 100);
        history.add(5.0, 1);
        history.add(5.0, 2);
        check(history.size() == 1 && history.lastValue(0) == 1, "the same message twice is one sample");
        history.add(Double.NaN, 3);
        check(history.size() == 1, "a time that is no number is ignored");
        history.add(0.1, 4);
        check(history.size() == 1 && history.lastValue(0) == 4, "a time that goes back");
    }

    private static void axesAreRound() {
        check(AxisRange.roundStep(0.1) == 0.1 && AxisRange.roundStep(0.11) == 0.2, "0.1, 0.2");
        check(AxisRange.roundStep(3) == 5 && AxisRange.roundStep(7) == 10 && AxisRange.roundStep(1e6) == 1e6, "5, 10, 1e6");
        AxisRange speeds = new AxisRange(-3.0, 178.0, 6);
        check(speeds.low == -50 && speeds.high == 200 && speeds.step == 50, "-50 to 200 by 50");
        check(speeds.fraction(-50) == 0 && speeds.fraction(75) == 0.5 && speeds.fraction(200) == 1, "fractions");
        AxisRange none = new AxisRange(2.0, 2.0, 6);
        check(none.high > none.low && none.fraction(2.0) >= 0, "a range without extent");
    }

    /** The row of the topmost pixel of this colour in a column, -1 if there is none. */
    private static int rowOf(BufferedImage image, int column, int colour) {
        for (int row = 24; row < image.getHeight() - 20; ++row) {
            if ((image.getRGB(column, row) & 0xffffff) == colour) {
                return row;
            }
        }
        return -1;
    }

    private static void chartDrawsLinesWhereTheValuesAre() {
        SampleHistory history = new SampleHistory(1, 10.0, 2000);
        for (int i = 0; i <= 1000; ++i) {
            history.add(i / 100.0, i > 400 && i < 600 ? Double.NaN : i <= 400 ? 0.25 : 0.75);
        }
        StripChart chart = new StripChart("slip", history, new int[] {0}, new String[] {"slip"}, 0.0, 1.0);
        BufferedImage image = new BufferedImage(568, 244, BufferedImage.TYPE_INT_RGB);  // 500 x 200 for the plot
        chart.setSize(568, 244);
        chart.paint(image.getGraphics());
        int blue = 0x1f5fa8;
        check(Math.abs(rowOf(image, 56 + 100, blue) - (24 + 150)) <= 1, "0.25 at 2 s");
        check(Math.abs(rowOf(image, 56 + 400, blue) - (24 + 50)) <= 1, "0.75 at 8 s");
        check(rowOf(image, 56 + 250, blue) == -1, "a gap at 5 s");
        check(chart.toString().equals("slip   slip 0.750"), "the latest value stands above it");
    }

    private static telemetry_t message(double timeS) {
        telemetry_t t = new telemetry_t();
        t.time_s = timeS;
        t.slip = t.omega1_rad_s = t.omega2_rad_s = t.theta_N = Double.NaN;  // hardware: no truth
        t.slip_est = 0.2;
        t.omega1_est_rad_s = 80;
        t.omega2_est_rad_s = 100;
        t.theta_est_N = 21;
        return t;
    }

    private static void panelTakesTruthElseEstimates() {
        Object[] latest = {null};
        ChartsPanel panel = new ChartsPanel(() -> latest[0]);
        panel.sample();
        check(panel.history().size() == 0, "no message yet");
        latest[0] = "something else";
        panel.sample();
        check(panel.history().size() == 0, "a message of another type");
        latest[0] = message(1.0);
        panel.sample();
        SampleHistory history = panel.history();
        check(history.lastValue(0) == 0.2 && history.lastValue(2) == 80 && history.lastValue(4) == 21, "estimates");
        telemetry_t known = message(1.02);
        known.slip = 0.19;
        latest[0] = known;
        panel.sample();
        check(history.size() == 2 && history.lastValue(0) == 0.19, "the truth");
        known = message(1.04);
        known.slip_est = Double.NEGATIVE_INFINITY;
        latest[0] = known;
        panel.sample();
        check(Double.isNaN(history.lastValue(0)), "slip at standstill is a gap");
    }

    private static telemetry_t signals(long stampNs, String names, double first, double second) {
        telemetry_t t = new telemetry_t();
        t.stamp_ns = stampNs;
        t.names = names;
        t.values = new double[] {first, second};
        t.value_count = t.values.length;
        return t;
    }

    private static void signalsPanelHasAChartForEachSignal() {
        Object[] latest = {"something else"};
        SignalsPanel panel = new SignalsPanel(() -> latest[0]);
        panel.sample();
        check(panel.getComponentCount() == 0, "no message yet");
        latest[0] = signals(7_000_000_000L, "I_m,zeta_N", 0.5, 15);
        panel.sample();
        latest[0] = signals(7_250_000_000L, "I_m,zeta_N", 0.75, 16);
        panel.sample();
        check(panel.getComponentCount() == 2, "two charts");
        check(panel.history().lastTime() == 0.25 && panel.history().lastValue(1) == 16, "time since the first message");
        check(panel.getComponent(1).toString().startsWith("zeta_N"), "the second chart has the second name");
        latest[0] = signals(3_000_000_000L, "V", 1, Double.NaN);
        panel.sample();
        check(panel.getComponentCount() == 1 && panel.history().lastTime() == 0, "another run has other charts");
    }

    private static void pluginIsForTelemetryOnly() {
        ChartsPlugin plugin = new ChartsPlugin();
        check(plugin.canHandle(telemetry_t.LCM_FINGERPRINT), "telemetry_t");
        check(!plugin.canHandle(abs_hil.status_t.LCM_FINGERPRINT), "status_t");
        plugin.getAction(null, null).actionPerformed(null);  // lcm-spy asks for the name without a desktop
    }

    private static void buttonFindsTheTelemetryRow() {
        DefaultTableModel model = new DefaultTableModel(new Object[] {"Channel", "Type"}, 0);
        JTable table = new JTable(model);
        check(AbsSpy.telemetryRow(table) == -1, "an empty table");
        model.addRow(new Object[] {"ABS_STATUS", "status_t"});
        model.addRow(new Object[] {"A_TELEMETRY", "telemetry_t"});
        model.addRow(new Object[] {"B_TELEMETRY", "telemetry_t"});
        check(AbsSpy.telemetryRow(table) == 1, "the first");
        table.setRowSelectionInterval(2, 2);
        check(AbsSpy.telemetryRow(table) == 2, "the selected one");
        table.setRowSelectionInterval(0, 0);
        check(AbsSpy.telemetryRow(table) == 1, "the selected one is none");
    }

    public static void main(String[] args) {
        historyKeepsItsWindow();
        historyNeverOutgrowsItsCapacity();
        historyStartsAnewWithAnotherRun();
        axesAreRound();
        chartDrawsLinesWhereTheValuesAre();
        panelTakesTruthElseEstimates();
        pluginIsForTelemetryOnly();
        buttonFindsTheTelemetryRow();
        System.out.println("all charts tests pass");
    }
}
