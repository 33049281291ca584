package abs_hil.spy;

import java.awt.AWTError;
import java.awt.BorderLayout;
import java.awt.Component;
import java.awt.Container;
import java.awt.Frame;
import java.awt.GridLayout;
import java.awt.HeadlessException;
import java.awt.Rectangle;
import java.awt.event.MouseEvent;
import javax.swing.JButton;
import javax.swing.JFrame;
import javax.swing.JPanel;
import javax.swing.JTable;
import javax.swing.SwingUtilities;

/** lcm-spy with a button that opens the charts. */
public final class AbsSpy {
    private static final int TYPE_COLUMN = 1;
    private static final int EXIT_UNAVAILABLE = 3;

    private AbsSpy() {}

    public static void main(String[] args) {
        try {
            lcm.spy.Spy.main(args);
            SwingUtilities.invokeLater(AbsSpy::addButton);
        } catch (HeadlessException | AWTError | UnsatisfiedLinkError | NoClassDefFoundError e) {
            fail("this Java cannot open windows here (" + e + ").\n"
                + "Check DISPLAY, and that a runtime with graphics is installed: sudo apt-get install default-jre");
        }
    }

    private static void fail(String message) {
        System.err.println("abs-spy: " + message);
        System.exit(EXIT_UNAVAILABLE);
    }

    private static void addButton() {
        for (Frame frame : Frame.getFrames()) {
            JTable table = frame instanceof JFrame ? find(frame, JTable.class) : null;
            if (table == null || !frame.getTitle().startsWith("LCM Spy")) {
                continue;
            }
            Container content = ((JFrame) frame).getContentPane();
            JButton clear = find(content, JButton.class);
            if (clear != null && clear.getActionListeners().length == 0) {
                fail("lcm-spy could not open the LCM network: its reason stands above.\n"
                    + "abs_hil doctor --only lcm says how to mend a missing multicast route");
            }
            JButton charts = new JButton("ABS charts");
            charts.addActionListener(event -> openCharts(table));
            charts.setEnabled(false);
            // lcm-spy fires its changes from a thread of its own.
            table.getModel().addTableModelListener(
                event -> SwingUtilities.invokeLater(() -> charts.setEnabled(telemetryRow(table) >= 0)));
            JPanel buttons = new JPanel(new GridLayout(1, 2));
            if (clear != null) {
                buttons.add(clear);
            }
            buttons.add(charts);
            content.add(buttons, BorderLayout.SOUTH);
            content.validate();
            return;
        }
        System.err.println("abs-spy: lcm-spy's window is not as expected; double-click the telemetry channel for charts");
    }

    /** As a double click on the row, for which lcm-spy opens our plug-in. */
    private static void openCharts(JTable table) {
        int row = telemetryRow(table);
        if (row < 0) {
            return;
        }
        Rectangle cell = table.getCellRect(row, TYPE_COLUMN, false);
        table.dispatchEvent(new MouseEvent(table, MouseEvent.MOUSE_CLICKED, System.currentTimeMillis(), 0,
            cell.x + 1, cell.y + cell.height / 2, 2, false, MouseEvent.BUTTON1));
    }

    /** The selected row if it is of telemetry_t, else the first that is, else -1. */
    static int telemetryRow(JTable table) {
        int selected = table.getSelectedRow();
        if (selected >= 0 && isTelemetry(table, selected)) {
            return selected;
        }
        for (int row = 0; row < table.getRowCount(); ++row) {
            if (isTelemetry(table, row)) {
                return row;
            }
        }
        return -1;
    }

    private static boolean isTelemetry(JTable table, int row) {
        return "telemetry_t".equals(table.getValueAt(row, TYPE_COLUMN));
    }

    private static <T extends Component> T find(Container container, Class<T> type) {
        for (Component component : container.getComponents()) {
            if (type.isInstance(component)) {
                return type.cast(component);
            }
            T inside = component instanceof Container ? find((Container) component, type) : null;
            if (inside != null) {
                return inside;
            }
        }
        return null;
    }
}
