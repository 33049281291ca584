import java.awt.Component;
import java.awt.Container;
import java.awt.Frame;
import java.awt.Point;
import java.awt.Rectangle;
import java.awt.Window;
import java.io.IOException;
import java.io.PrintWriter;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.Paths;
import java.nio.file.StandardCopyOption;
import javax.swing.JTable;
import javax.swing.SwingUtilities;

/**
 * A Java agent for tests: twice a second writes what stands in the windows of the program it is loaded into, lcm-spy's
 * table among it, to the file named as its argument. It only looks. Lines of words with tabs between:
 * window TITLE X Y WIDTH HEIGHT; cell ROW COLUMN TEXT X Y (its middle on the screen).
 */
public final class SpyProbe {
    public static void premain(String file) {
        Thread thread = new Thread(() -> watch(Paths.get(file)), "probe");
        thread.setDaemon(true);
        thread.start();
    }

    private static void watch(Path file) {
        Path fresh = Paths.get(file + ".new");
        try {
            while (true) {
                Thread.sleep(500);
                if (Frame.getFrames().length == 0) {
                    continue;  // not to start AWT before the program does
                }
                try (PrintWriter out = new PrintWriter(Files.newBufferedWriter(fresh))) {
                    SwingUtilities.invokeAndWait(() -> describe(out));
                }
                Files.move(fresh, file, StandardCopyOption.ATOMIC_MOVE);
            }
        } catch (IOException | InterruptedException | ReflectiveOperationException e) {
            System.err.println("probe: " + e);
        }
    }

    private static void describe(PrintWriter out) {
        for (Window window : Window.getWindows()) {
            if (!window.isShowing()) {
                continue;
            }
            String title = window instanceof Frame ? ((Frame) window).getTitle() : "";
            Rectangle at = window.getBounds();
            line(out, "window", title, at.x, at.y, at.width, at.height);
            describe(out, window);
        }
    }

    private static void describe(PrintWriter out, Container container) {
        for (Component component : container.getComponents()) {
            if (!component.isShowing()) {
                continue;
            }
            Point at = component.getLocationOnScreen();
            if (component instanceof JTable) {
                describe(out, (JTable) component, at);
            }
            if (component instanceof Container) {
                describe(out, (Container) component);
            }
        }
    }

    private static void describe(PrintWriter out, JTable table, Point origin) {
        for (int row = 0; row < table.getRowCount(); ++row) {
            for (int column = 0; column < table.getColumnCount(); ++column) {
                Rectangle cell = table.getCellRect(row, column, true);
                line(out, "cell", row, table.getColumnName(column), table.getValueAt(row, column),
                    origin.x + cell.x + cell.width / 2, origin.y + cell.y + cell.height / 2);
            }
        }
    }

    private static void line(PrintWriter out, Object... words) {
        for (int i = 0; i < words.length; ++i) {
            out.print((i == 0 ? "" : "\t") + String.valueOf(words[i]).trim());
        }
        out.println();
    }
}
