"""The page in headless Chromium, opened from disk: figures with all their curves, zoom, hover, print, no error."""
import base64
import time
import unittest

from chromium import Chromium
from page_reader import PageReader
from program import ReportTest, need

need('chromium', 'chromium')

BEFORE_AFTER_S = 0.2  # margin around braking in the figures
# The second with gains whose braking has less than 2800 rows.
RUNS = {'adaptive': (), 'sliding-mode': ('--set', 'control.sliding_mode.gain_m_s2=14', '--set', 'control.sliding_mode.gamma=4.5')}
OF_BRAKING = ('braking', 'fig5', 'fig6', 'fig7', 'fig8', 'fig9', 'fig10', 'signals')


class Browser(ReportTest):
    page = None  # of one making for all tests

    def make_page(self):
        folders = [self.make_run(controller, '--controller', controller, *gains) for controller, gains in RUNS.items()]
        self.report(*folders)
        Browser.rows_of = []
        for folder in folders:
            rows = self.rows(folder)
            braking = [i for i, row in enumerate(rows) if row['phase'] == 'brake']
            start, end = float(rows[braking[0]]['time_s']), float(rows[braking[-1] + 1]['time_s'])
            self.rows_of.append([row for row in rows
                                 if start - BEFORE_AFTER_S <= float(row['time_s']) <= end + BEFORE_AFTER_S])
        Browser.page = (self.folder / 'report.html').read_text()

    def setUp(self):
        super().setUp()
        if self.page is None:
            self.make_page()
        (self.folder / 'report.html').write_text(self.page)
        self.read = PageReader(self.page)
        self.browser = Chromium(self.folder, (self.folder / 'report.html').as_uri())
        self.browser.wait_for(f'document.body && document.body.dataset.drawn == "{len(self.read.plots)}"', 'all figures')

    def tearDown(self):
        self.browser.close()
        super().tearDown()

    def test_curves(self):
        expected = {
            'braking': ['omega1'] * 2 + ['omega2'] * 2 + ['slip'] * 2 + ['slip_ref'] + ['torque_ref'] * 2,
            'profile': ['omega2'] * 2,
            'fig5': ['omega1'] * 2,
            'fig6': ['omega2'] * 2,
            'fig7': ['slip'] * 2 + ['slip_ref'] + ['slip_error'] * 2,
            'fig8': ['torque_ref'] * 2 + ['torque'] * 2,
            'fig9': ['theta_est'] * 2 + ['theta'] + ['theta_error'] * 2,
            'fig10': ['distance'] * 2,
            'signals': ['I_m', 'omega1_hat_rad_s', 'zeta_N', 'V', 'V_dot'],  # of adaptive
        }
        self.assertEqual({figure: sorted(c['quantity'] for c in curves) for figure, curves in self.read.figures.items()},
                         {figure: sorted(quantities) for figure, quantities in expected.items()})
        drawn = {figure: self.browser.value(f'document.querySelectorAll("#plot-{figure} .scatterlayer .js-line").length')
                 for figure in expected}
        self.assertEqual(drawn, {figure: len(quantities) for figure, quantities in expected.items()})
        self.assertEqual(self.browser.said, [])

    def test_points(self):
        """Up to 2800 rows nothing is thinned: each row with a value is a point."""
        for figure, panel, column in (('fig5', 'a', 'omega1_rad_s'), ('fig6', 'a', 'omega2_rad_s'),
                                      ('fig8', 'a', 'brake_torque_ref_Nm'), ('fig8', 'b', 'brake_torque_Nm'),
                                      ('fig10', 'a', 'distance_m'), ('fig7', 'a', 'slip'), ('fig9', 'a', 'theta_est_N')):
            for run, rows in enumerate(self.rows_of, 1):
                values = [float(row[column]) for row in rows if row['phase'] == 'brake' or figure not in ('fig7', 'fig9')]
                values = [value for value in values if value == value]
                self.assertGreater(len(values), 2000)
                curve = self.read.curve(figure, panel, run)
                self.assertEqual((curve['run'], curve['said'], curve['drawn']), (run, len(values), len(values)),
                                 (figure, column))
                for (_, y), value in zip(curve['xy'], values):
                    self.assertAlmostEqual(y, value, delta=1e-6 * max(1.0, abs(value)))
                held = self.browser.value(f'document.getElementById("plot-{figure}").data.map(t => t.y.length)')
                self.assertIn(len(values), held)

    def test_curve_stands_where_the_rows_say(self):
        """The axis' own transformation puts the least and the greatest value of the first curve where its path has them."""
        for run, rows in enumerate(self.rows_of, 1):
            values = [float(row['omega1_rad_s']) for row in rows]
            path = self.browser.value(f'document.querySelectorAll("#plot-fig5 .scatterlayer .js-line")[{run - 1}]'
                                      '.getAttribute("d")')
            pixels = [float(pair.split(',')[1]) for pair in path.replace('M', '').split('L')]
            wanted = self.browser.value('((axis) => [axis.l2p(%r), axis.l2p(%r)])'
                                        '(document.getElementById("plot-fig5")._fullLayout.yaxis)' % (max(values), min(values)))
            self.assertAlmostEqual(min(pixels), wanted[0], delta=1.0)
            self.assertAlmostEqual(max(pixels), wanted[1], delta=1.0)
            self.assertGreater(wanted[1] - wanted[0], 150.0)

    def area(self, figure):
        """Rectangle of the first panel's plot area in the window, after scrolling there."""
        self.browser.value(f'document.getElementById("plot-{figure}").scrollIntoView({{block: "center"}})')
        return self.browser.value(f'''(() => {{ const place = document.querySelector("#plot-{figure} .nsewdrag")
            .getBoundingClientRect(); return [place.left, place.top, place.width, place.height]; }})()''')

    def ranges(self, figures):
        return [self.browser.value(f'document.getElementById("plot-{figure}").layout.xaxis.range.map(Number)')
                for figure in figures]

    def test_a_drag_zooms_all_axes_of_the_same_time_and_a_double_click_shows_all(self):
        before, profile = self.ranges(OF_BRAKING), self.ranges(['profile'])
        left, top, width, height = self.area('fig6')
        self.browser.drag(left + 0.25 * width, left + 0.5 * width, top + 0.5 * height)
        low, high = before[0]
        self.browser.wait_for('document.getElementById("plot-signals").layout.xaxis.range[0] > 0.1', 'the zoom')
        after = self.ranges(OF_BRAKING)
        for found in after:
            self.assertAlmostEqual(found[0], low + 0.25 * (high - low), delta=0.02)
            self.assertAlmostEqual(found[1], low + 0.5 * (high - low), delta=0.02)
        self.assertEqual(self.ranges(['profile']), profile, 'another axis of time')
        # Two clicks are a double click only within 0.3 s, which a busy machine may miss.
        for _ in range(20):
            for click in (1, 2):
                for kind in ('mousePressed', 'mouseReleased'):
                    self.browser.mouse(kind, left + 0.4 * width, top + 0.5 * height, button='left', clickCount=click)
            time.sleep(0.5)
            if self.ranges(OF_BRAKING)[0][0] < low + 0.1 * (high - low):
                break
        self.browser.wait_for(f'Math.abs(document.getElementById("plot-fig9").layout.xaxis.range[0] - {low}) < 1e-9',
                              'all of it again')
        self.assertEqual(self.ranges(OF_BRAKING), before)
        self.assertEqual(self.browser.said, [])

    def test_hover_shows_values(self):
        left, top, width, height = self.area('fig6')
        for step in range(5):
            self.browser.mouse('mouseMoved', left + (0.4 + 0.002 * step) * width, top + 0.5 * height)
        text = self.browser.wait_for('document.querySelector("#plot-fig6 .hoverlayer").textContent', 'the values')
        for name in RUNS:
            self.assertIn(name, text)
        self.assertRegex(text, r'\d')

    def test_the_pointer_is_told_name_value_unit_and_time(self):
        left, top, width, height = self.area('fig8')
        for step in range(5):
            self.browser.mouse('mouseMoved', left + (0.5 + 0.002 * step) * width, top + 0.1 * height)
        text = self.browser.wait_for('document.querySelector("#plot-fig8 .hoverlayer").textContent', 'the values')
        self.assertRegex(text, r'^-?[\d.−]+ s')
        for name in RUNS:
            self.assertRegex(text, rf'{name}[^:]* : torque asked for [\d.−]+ N m')

    def test_y_follows_a_zoom_where_one_asks_for_it(self):
        def y_range(figure):
            return self.browser.value(f'document.getElementById("plot-{figure}").layout.yaxis.range.map(Number)')
        before = y_range('fig8')
        left, top, width, height = self.area('fig6')
        self.browser.drag(left + 0.5 * width, left + 0.6 * width, top + 0.5 * height)
        self.browser.wait_for('document.getElementById("plot-signals").layout.xaxis.range[0] > 0.1', 'the zoom')
        self.assertEqual(y_range('fig8'), before, 'not asked for')
        self.browser.value('document.getElementById("follow").click()')
        low, high = self.ranges(['fig8'])[0]
        inside = [y for run in (1, 2) for x, y in self.read.curve('fig8', 'a', run)['xy'] if low <= x <= high]
        room = 0.05 * (max(inside) - min(inside))
        self.browser.wait_for('document.getElementById("plot-fig10").layout.yaxis.range[0] > 1', 'the last figure')
        found = y_range('fig8')
        self.assertAlmostEqual(found[0], min(inside) - room, delta=1e-4)
        self.assertAlmostEqual(found[1], max(inside) + room, delta=1e-4)
        self.browser.value('document.getElementById("follow").click()')
        self.browser.wait_for('document.getElementById("plot-fig10").layout.yaxis.range[0] < 1', 'as before')
        self.assertEqual(self.browser.said, [])

    def test_the_first_screen_has_braking_and_the_figures_of_merit_beside_it(self):
        self.browser.call('Emulation.setDeviceMetricsOverride', width=1400, height=900, deviceScaleFactor=1, mobile=False)
        self.browser.wait_for('innerWidth == 1400 && document.documentElement.scrollWidth == 1400', 'figures within the width')
        self.browser.value('scrollTo(0, 0)')
        figure, table = (self.browser.value(f'''(() => {{ const r = document.querySelector("{place}").getBoundingClientRect();
            return [r.left, r.right, r.top, r.bottom]; }})()''') for place in ('#figure-braking', '#metrics'))
        self.assertLess(figure[1], table[0] + 1, 'beside')
        self.assertLess(max(figure[3], table[3]), 900)
        self.assertLess(table[1], 1400)

    def test_a_dark_screen_gets_a_dark_page(self):
        def colours():
            return self.browser.value('''[getComputedStyle(document.body).backgroundColor,
                document.getElementById("plot-fig5")._fullLayout.plot_bgcolor,
                document.getElementById("plot-fig7").data.find((t) => t.meta.quantity == "slip_ref").line.color]''')
        self.assertEqual(colours(), ['rgb(255, 255, 255)', '#ffffff', '#000000'])
        self.browser.call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': 'dark'}])
        self.browser.wait_for('document.getElementById("plot-signals")._fullLayout.plot_bgcolor != "#ffffff"', 'dark figures')
        self.assertEqual(colours(), ['rgb(21, 23, 26)', '#15171a', '#f4f4f4'])
        self.assertEqual(self.browser.said, [])

    def test_a_reader_of_the_screen_finds_names_and_landmarks(self):
        nodes = self.browser.call('Accessibility.getFullAXTree')['nodes']
        roles = [(node['role']['value'], node.get('name', {}).get('value', '')) for node in nodes if not node['ignored']]
        for role in ('main', 'banner', 'contentinfo', 'table', 'checkbox'):
            self.assertIn(role, [found for found, _ in roles])
        pictures = {name for role, name in roles if role in ('image', 'img')}
        self.assertEqual(len(self.read.alternatives), len(self.read.plots))
        for name in self.read.alternatives.values():
            self.assertIn(name, pictures)
            self.assertRegex(name, r': .* to ')

    def test_print_and_picture(self):
        pdf = base64.b64decode(self.browser.call('Page.printToPDF')['data'])
        self.assertEqual(pdf[:5], b'%PDF-')
        self.assertGreater(len(pdf), 50_000)
        picture = base64.b64decode(self.browser.call('Page.captureScreenshot')['data'])
        self.assertEqual(picture[:8], b'\x89PNG\r\n\x1a\n')
        self.assertGreater(len(picture), 30_000, 'an empty page')


if __name__ == '__main__':
    unittest.main()
