package abs_hil.spy;

import abs_hil.telemetry_t;
import java.awt.Dimension;
import java.awt.Window;
import java.awt.event.ActionEvent;
import java.beans.PropertyVetoException;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import javax.swing.JInternalFrame;
import javax.swing.JTabbedPane;
import javax.swing.SwingUtilities;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;

/** lcm-spy finds this on its class path and opens it for channels of telemetry_t, on a double click. */
public final class ChartsPlugin implements SpyPlugin {
    @Override
    public boolean canHandle(long fingerprint) {
        return fingerprint == telemetry_t.LCM_FINGERPRINT;
    }

    /** lcm-spy asks once without a desktop, for the name alone, and once with the desktop to open in. */
    @Override
    public Action getAction(JDesktopPane desktop, ChannelData channel) {
        return new AbstractAction("ABS charts") {
            @Override
            public void actionPerformed(ActionEvent event) {
                if (desktop != null) {
                    open(desktop, channel);
                }
            }
        };
    }

    private static void open(JDesktopPane desktop, ChannelData channel) {
        Window window = SwingUtilities.getWindowAncestor(desktop);
        if (window != null) {
            window.setSize(new Dimension(820, 640));
            window.validate();
        }
        JInternalFrame frame = new JInternalFrame(channel.name + " charts", true, true, true, true);
        JTabbedPane tabs = new JTabbedPane();
        tabs.addTab("run", new ChartsPanel(() -> channel.last));
        tabs.addTab("controller's signals", new SignalsPanel(() -> channel.last));
        frame.add(tabs);
        frame.pack();
        desktop.add(frame);
        frame.setVisible(true);
        try {
            frame.setMaximum(true);
        } catch (PropertyVetoException e) {
            frame.setSize(desktop.getSize());  // nobody vetoes; it would just not fill its window
        }
    }
}
