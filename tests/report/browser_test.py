"""The page in headless Chromium: every figure is visible and has the right number of curves and points."""
import subprocess
import unittest

from page_reader import PageReader
from program import ReportTest, need

need('gnuplot', 'gnuplot-nox')
need('chromium', 'chromium')

BEFORE_AFTER_S = 0.2  # margin around braking in the figures
RUNS = ('adaptive', 'sliding-mode')


class Browser(ReportTest):
    def chromium(self, *args):
        result = subprocess.run(
            ['chromium', '--headless', '--no-sandbox', '--disable-gpu', '--hide-scrollbars',
             f'--user-data-dir={self.folder}/profile', *args, (self.folder / 'report.html').as_uri()],
            capture_output=True, text=True, timeout=120, cwd=self.folder, check=True)
        return result.stdout

    def setUp(self):
        super().setUp()
        folders = [self.make_run(controller, '--controller', controller) for controller in RUNS]
        self.report(*folders)
        self.rows_of = []
        for folder in folders:
            rows = self.rows(folder)
            braking = [i for i, row in enumerate(rows) if row['phase'] == 'brake']
            start, end = float(rows[braking[0]]['time_s']), float(rows[braking[-1] + 1]['time_s'])
            self.rows_of.append([row for row in rows
                                 if start - BEFORE_AFTER_S <= float(row['time_s']) <= end + BEFORE_AFTER_S])
        self.read = PageReader(self.chromium('--dump-dom'))

    def test_curves(self):
        expected = {
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
                self.assertEqual((curve['run'], curve['said']), (run, len(values)), (figure, column))
                if figure not in ('fig7', 'fig9'):  # the other axes cut off values that diverge towards standstill
                    self.assertEqual(curve['drawn'], len(values), (figure, column))

    def test_curve_stands_where_the_rows_say(self):
        """The drawn curve is an affine image of the rows: pixels over values lie on one straight line."""
        for run, rows in enumerate(self.rows_of, 1):
            pixels = [y for _, y in self.read.curve('fig5', 'a', run)['xy']]
            values = [float(row['omega1_rad_s']) for row in rows]
            high, low = values.index(max(values)), values.index(min(values))
            slope = (pixels[high] - pixels[low]) / (values[high] - values[low])
            self.assertLess(slope, -0.5)  # it points upwards and fills its frame: 240 px for 170 rad/s
            for pixel, value in zip(pixels, values):
                self.assertAlmostEqual(pixel, pixels[low] + slope * (value - values[low]), delta=0.02)

    def test_screenshot(self):
        picture = self.folder / 'picture.png'
        self.chromium('--window-size=900,1200', f'--screenshot={picture}')
        self.assertEqual(picture.read_bytes()[:8], b'\x89PNG\r\n\x1a\n')
        self.assertGreater(picture.stat().st_size, 30_000, 'an empty page')


if __name__ == '__main__':
    unittest.main()
