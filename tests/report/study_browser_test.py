"""The page of a study in headless Chromium: maps as fine as the design with the border of success, hover, both themes."""
import subprocess
import unittest

from chromium import Chromium
from program import ABS_HIL, ReportTest, need

need('chromium', 'chromium')

FINE, SLIPS = 14, 9  # levels of the two factors
# On a tyre that is too weak the wheel has not stopped after 3 s: such runs end by a fault.
STUDY = f"""
[factors]
plant.theta_N = {{ from = 2, to = 28, steps = {FINE} }}
control.slip_ref = {{ from = 0.06, to = 0.22, steps = {SLIPS} }}

[settings]
experiment.brake_limit_s = 3
"""
MAP = 'maps-stop_distance_m'


class StudyBrowser(ReportTest):
    page = None  # of one making for all tests

    def setUp(self):
        super().setUp()
        if self.page is None:
            (self.folder / 'study.toml').write_text(STUDY)
            made = subprocess.run([ABS_HIL, 'study', self.folder / 'study.toml', '--out', self.folder / 'study'],
                                  capture_output=True, text=True, timeout=120, check=False)
            self.assertEqual(made.returncode, 0, made.stderr)
            self.report(self.folder / 'study')
            StudyBrowser.page = (self.folder / 'report.html').read_text()
        (self.folder / 'report.html').write_text(self.page)
        self.browser = Chromium(self.folder, (self.folder / 'report.html').as_uri())
        self.browser.wait_for('document.body && document.body.dataset.drawn == document.querySelectorAll(".plot").length',
                              'all figures')

    def tearDown(self):
        self.browser.close()
        super().tearDown()

    def data(self, expression):
        return self.browser.value(f'document.getElementById("plot-{MAP}").data.{expression}')

    def test_a_map_has_a_cell_for_each_point_of_the_design(self):
        heat = 'find((t) => t.type == "heatmap")'
        self.assertEqual(self.data(f'{heat}.z.length') * self.data(f'{heat}.z[0].length'), FINE * SLIPS)
        self.assertEqual(len(self.data(f'{heat}.x')) * len(self.data(f'{heat}.y')), FINE * SLIPS)
        self.assertIn('image', self.browser.value(f'document.querySelector("#plot-{MAP} .heatmaplayer").innerHTML'))
        self.assertEqual(self.browser.said, [])

    def test_the_scale_ends_with_its_map(self):
        scale, cells = (self.browser.value(f'''(() => {{ const r = document.querySelector("#plot-{MAP} {place}")
            .getBoundingClientRect(); return [r.top, r.bottom]; }})()''') for place in ('.cbfills', '.nsewdrag'))
        self.assertGreater(scale[0], cells[0] - 2.0, 'into the buttons')
        self.assertLess(scale[1], cells[1] + 2.0)

    def test_reasons_are_said_in_words(self):
        reasons = self.browser.value('document.getElementById("reasons").textContent')
        self.assertIn('time limit', reasons)
        self.assertNotIn('_', reasons)

    def test_the_border_of_success_is_drawn_between_completed_and_other_runs(self):
        share = self.data('find((t) => t.type == "contour").z')
        flat = [cell for row in share for cell in row]
        self.assertEqual(set(flat), {0, 1}, 'runs of both kinds')
        paths = self.browser.value(f'''[...document.querySelectorAll("#plot-{MAP} .contourlayer path")]
            .filter((path) => getComputedStyle(path).stroke == "rgb(213, 94, 0)" && path.getTotalLength() > 100).length''')
        self.assertGreaterEqual(paths, 1)

    def test_the_pointer_is_told_figure_and_factors(self):
        self.browser.value(f'document.getElementById("plot-{MAP}").scrollIntoView({{block: "center"}})')
        left, top, width, height = self.browser.value(f'''(() => {{ const place = document.querySelector("#plot-{MAP} .nsewdrag")
            .getBoundingClientRect(); return [place.left, place.top, place.width, place.height]; }})()''')
        for step in range(5):
            self.browser.mouse('mouseMoved', left + (0.8 + 0.002 * step) * width, top + 0.5 * height)
        text = self.browser.wait_for(f'document.querySelector("#plot-{MAP} .hoverlayer").textContent', 'the values')
        self.assertRegex(text, r'stop distance / m: \d')
        self.assertRegex(text, r'wanted slip: 0\.\d')
        self.assertRegex(text, r'/ N: \d')
        self.assertNotIn('plant.', text)

    def test_both_themes(self):
        def colours():
            return self.browser.value(f'''[getComputedStyle(document.body).backgroundColor,
                document.getElementById("plot-{MAP}")._fullLayout.plot_bgcolor,
                document.getElementById("plot-{MAP}")._fullLayout.font.color]''')
        light = colours()
        self.assertEqual(light[:2], ['rgb(255, 255, 255)', '#ffffff'])
        self.browser.call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': 'dark'}])
        self.browser.wait_for(f'document.getElementById("plot-{MAP}")._fullLayout.plot_bgcolor != "#ffffff"', 'dark figures')
        dark = colours()
        self.assertEqual(dark[:2], ['rgb(21, 23, 26)', '#15171a'])
        self.assertNotEqual(dark[2], light[2])
        self.assertEqual(self.browser.said, [])


if __name__ == '__main__':
    unittest.main()
