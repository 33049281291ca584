package abs_hil.spy;

import java.awt.BasicStroke;
import java.awt.Color;
import java.awt.Dimension;
import java.awt.FontMetrics;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.RenderingHints;
import java.awt.geom.Path2D;
import java.util.Locale;
import javax.swing.JComponent;

/** Draws some quantities of a history over its time window, each with its latest value. */
final class StripChart extends JComponent {
    private static final Color[] COLOURS = {new Color(0x1f5fa8), new Color(0xd9541e), new Color(0x4a8f3c)};
    private static final Color GRID = new Color(0xdddddd);
    private static final int LEFT = 56;
    private static final int RIGHT = 12;
    private static final int TOP = 24;
    private static final int BOTTOM = 20;

    private final String title;
    private final SampleHistory history;
    private final int[] quantities;
    private final String[] names;
    private final double leastLow;
    private final double leastHigh;

    /** The axis always shows {@code leastLow} to {@code leastHigh}, and more where the values go beyond. */
    StripChart(String title, SampleHistory history, int[] quantities, String[] names, double leastLow, double leastHigh) {
        this.title = title;
        this.history = history;
        this.quantities = quantities;
        this.names = names;
        this.leastLow = leastLow;
        this.leastHigh = leastHigh;
        setPreferredSize(new Dimension(760, 200));
    }

    /** Title and latest values, as drawn above the chart. */
    @Override
    public String toString() {
        StringBuilder text = new StringBuilder(title);
        for (int line = 0; line < quantities.length; ++line) {
            text.append("   ").append(label(line));
        }
        return text.toString();
    }

    private String label(int line) {
        return String.format(Locale.ROOT, "%s %.3f", names[line], history.lastValue(quantities[line]));
    }

    private AxisRange range() {
        double low = leastLow;
        double high = leastHigh;
        for (int quantity : quantities) {
            for (int i = 0; i < history.size(); ++i) {
                double value = history.value(quantity, i);
                if (!Double.isNaN(value) && !Double.isInfinite(value)) {
                    low = Math.min(low, value);
                    high = Math.max(high, value);
                }
            }
        }
        return new AxisRange(low, high, 6);
    }

    @Override
    protected void paintComponent(Graphics graphics) {
        Graphics2D g = (Graphics2D) graphics.create();
        g.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
        g.setRenderingHint(RenderingHints.KEY_TEXT_ANTIALIASING, RenderingHints.VALUE_TEXT_ANTIALIAS_ON);
        g.setColor(Color.WHITE);
        g.fillRect(0, 0, getWidth(), getHeight());
        AxisRange axis = range();
        double end = history.size() == 0 ? history.windowS() : Math.max(history.lastTime(), history.windowS());
        paintGrid(g, axis, end);
        paintTitle(g);
        g.clipRect(LEFT, TOP, plotWidth() + 1, plotHeight() + 1);
        for (int line = 0; line < quantities.length; ++line) {
            g.setColor(COLOURS[line % COLOURS.length]);
            g.setStroke(new BasicStroke(1.6f, BasicStroke.CAP_ROUND, BasicStroke.JOIN_ROUND));
            g.draw(path(quantities[line], axis, end));
        }
        g.dispose();
    }

    private int plotWidth() {
        return Math.max(1, getWidth() - LEFT - RIGHT);
    }

    private int plotHeight() {
        return Math.max(1, getHeight() - TOP - BOTTOM);
    }

    private double y(AxisRange axis, double value) {
        return TOP + (1.0 - axis.fraction(value)) * plotHeight();
    }

    private double x(double timeS, double endS) {
        return LEFT + (1.0 - (endS - timeS) / history.windowS()) * plotWidth();
    }

    private void paintGrid(Graphics2D g, AxisRange axis, double endS) {
        FontMetrics font = g.getFontMetrics();
        int decimals = (int) Math.max(0, -Math.floor(Math.log10(axis.step) + 1e-9));
        for (double value = axis.low; value < axis.high + axis.step / 2; value += axis.step) {
            int at = (int) Math.round(y(axis, value));
            g.setColor(GRID);
            g.drawLine(LEFT, at, LEFT + plotWidth(), at);
            g.setColor(Color.DARK_GRAY);
            String text = String.format(Locale.ROOT, "%." + decimals + "f", value);
            g.drawString(text, LEFT - 6 - font.stringWidth(text), at + font.getAscent() / 2 - 1);
        }
        double step = AxisRange.roundStep(history.windowS() / 10);
        for (double time = Math.ceil((endS - history.windowS()) / step) * step; time <= endS + 1e-9; time += step) {
            int at = (int) Math.round(x(time, endS));
            g.setColor(GRID);
            g.drawLine(at, TOP, at, TOP + plotHeight());
            g.setColor(Color.DARK_GRAY);
            String text = String.format(Locale.ROOT, "%.0f s", time);
            g.drawString(text, at - font.stringWidth(text) / 2, TOP + plotHeight() + font.getAscent() + 2);
        }
    }

    private void paintTitle(Graphics2D g) {
        FontMetrics font = g.getFontMetrics();
        int at = LEFT;
        g.setColor(Color.BLACK);
        g.drawString(title, at, TOP - 8);
        at += font.stringWidth(title) + 24;
        for (int line = 0; line < quantities.length; ++line) {
            g.setColor(COLOURS[line % COLOURS.length]);
            g.drawString(label(line), at, TOP - 8);
            at += Math.max(font.stringWidth(label(line)), 90) + 20;
        }
    }

    private Path2D path(int quantity, AxisRange axis, double endS) {
        Path2D path = new Path2D.Double();
        boolean gap = true;
        for (int i = 0; i < history.size(); ++i) {
            double value = history.value(quantity, i);
            if (Double.isNaN(value)) {
                gap = true;
            } else if (gap) {
                path.moveTo(x(history.time(i), endS), y(axis, value));
                gap = false;
            } else {
                path.lineTo(x(history.time(i), endS), y(axis, value));
            }
        }
        return path;
    }
}
