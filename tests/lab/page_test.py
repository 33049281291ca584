"""The page of `abs_hil lab` in headless Chromium, opened from disk: the program's bits, sliders, link, files, exercise.

usage: page_test.py ABS_HIL ABS_LAB MODULE TABLE
"""
import base64
import csv
import hashlib
import html
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import time

MODULE, TABLE = map(pathlib.Path, sys.argv[3:5])
del sys.argv[3:5]
sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / 'report'))
from chromium import Chromium  # noqa: E402
from program import ABS_HIL, ABS_REPORT as ABS_LAB, ReportTest, need, unittest  # noqa: E402

need('chromium', 'chromium')
if not MODULE.exists():
    print(f'SKIPPED: {MODULE} is missing: scripts/lab.sh makes it')
    sys.exit(77)

START = 'experiment.start_speed_rad_s=170'
KEYS = {'ArrowRight': 39, 'ArrowLeft': 37, 'Tab': 9, 'Enter': 13, 'Home': 36, 'End': 35}


def words_of(**more):
    return '&'.join(['controller=adaptive', 'plant=paper-table1', 'experiment=paper', START, *(f'{k}={v}' for k, v in more.items())])


class Page(ReportTest):
    def setUp(self):
        super().setUp()
        self.browser = None

    def tearDown(self):
        if self.browser is not None:
            self.browser.close()
        super().tearDown()

    def lab(self, *arguments):
        result = subprocess.run([ABS_LAB, '--out', self.folder / 'lab.html', *arguments], capture_output=True, text=True,
                                timeout=60, cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)

    def open(self, link='', scheme='light', width=1500, height=1300):
        if self.browser is None:
            self.browser = Chromium(self.folder, 'about:blank', width, height)
        call = self.browser.call
        call('Emulation.setDeviceMetricsOverride', width=width, height=height, deviceScaleFactor=1, mobile=False)
        call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': scheme},
                                                     {'name': 'prefers-reduced-motion', 'value': 'reduce'}])
        call('Browser.setDownloadBehavior', behavior='allow', downloadPath=str(self.folder))
        call('Page.navigate', url='about:blank')
        call('Page.navigate', url=(self.folder / 'lab.html').as_uri() + link)
        self.browser.wait_for('document.body && document.body.dataset.drawn', 'the first figure')

    def value(self, expression):
        return self.browser.value(expression)

    def press(self, key):
        for kind in ('keyDown', 'keyUp'):
            self.browser.call('Input.dispatchKeyEvent', type=kind, key=key, windowsVirtualKeyCode=KEYS[key],
                              **({'text': '\r'} if key == 'Enter' and kind == 'keyDown' else {}))

    def after(self, act):
        """Waits until the page has drawn what `act` changed."""
        before = int(self.value('document.body.dataset.drawn'))
        act()
        self.browser.wait_for(f'+document.body.dataset.drawn > {before}', 'the change drawn')

    def set_field(self, key, value):
        self.after(lambda: self.value(f'''(() => {{ const field = document.getElementById("option-{key.replace('.', '-')}");
            field.value = {value!r}; field.dispatchEvent(new Event("change")); }})()'''))

    def figures(self):
        """title -> texts of the runs"""
        return dict(self.value('''[...document.querySelectorAll("#figures tbody tr")].map((line) =>
            [line.children[0].textContent, [...line.children].slice(1).map((cell) => cell.textContent)])'''))

    def downloaded(self, name):
        path = self.folder / name
        for _ in range(300):
            if path.exists():
                return path
            time.sleep(0.1)
        raise AssertionError(f'{name} was not saved')

    def program(self, line, *more):
        """Runs the line of the page with other outputs, and returns the run's CSV."""
        words = shlex.split(line)
        self.assertEqual((words[0], words[-2]), ('abs_hil', '--out'))
        result = subprocess.run([ABS_HIL, *words[1:-2], '--no-out', '--csv', 'program.csv', '--summary', 'program.json', *more],
                                capture_output=True, text=True, cwd=self.folder, timeout=60)
        self.assertEqual(result.returncode, 0, result.stderr)
        return (self.folder / 'program.csv').read_bytes()

    def test_the_programs_bits(self):
        self.lab()
        self.open()
        rows = [line.split('\t') for line in TABLE.read_text().splitlines()]
        for checksum, words in rows:
            rows_text = self.value(f'window.lab.then(({{engine}}) => engine.csv({words.split()!r}))')
            self.assertEqual(hashlib.sha256(rows_text.partition('\n')[2].encode()).hexdigest(), checksum, words)
        self.assertEqual(len(rows), 15)
        self.assertEqual(self.browser.said, [])

    def test_it_is_one_file_of_at_most_3_MB(self):
        self.lab()
        text = (self.folder / 'lab.html').read_text()
        self.assertLess(len(text.encode()), 3_000_000)
        self.assertEqual(re.findall(r'(?:src|href)="(?!data:)[^"]*"', re.sub(r'<script.*?</script>', '', text, flags=re.S)), [])
        policy = html.unescape(re.search('Content-Security-Policy" content="([^"]*)"', text)[1])
        self.assertIn("default-src 'none'", policy)
        self.assertNotIn('http', policy)

    def test_a_slider_by_key_changes_figures_link_and_line(self):
        self.lab()
        self.open()
        before = self.figures()['stop distance, m']
        self.value('document.querySelector("input[type=range][aria-label=\\"control.slip_ref\\"]").focus()')
        for _ in range(3):
            self.after(lambda: self.press('ArrowRight'))
        line = self.value('document.getElementById("line-simulator").value')
        self.assertRegex(line, r'--set control\.slip_ref=0\.1\d+')
        self.assertIn('control.slip_ref=0.1', self.value('location.hash'))
        after = self.figures()['stop distance, m']
        self.assertNotEqual(before, after)
        self.program(line)
        summary = self.summary_of('program.json')
        self.assertEqual(after, [f'{summary["stop_distance_m"]:.2f}'])
        self.assertEqual(self.figures()['slip RMS error'], [f'{summary["slip_rms"]:.4f}'])
        self.assertEqual(self.browser.said, [])

    def summary_of(self, name):
        return json.loads((self.folder / name).read_text())

    def test_the_link_carries_runs_and_settings(self):
        self.lab()
        self.open('#' + words_of() + '&&' + words_of(**{'control.slip_ref': 0.08, 'plant.friction_profile':
                                                        'braking distance: 1; 0.5 at 4; 1 from 6 to 7'}).replace('adaptive', 'pi'))
        self.assertEqual(len(self.figures()['stop distance, m']), 2)
        first, link = self.figures(), self.value('location.hash')
        self.open(link)
        self.assertEqual((self.figures(), self.value('location.hash')), (first, link))
        self.value('document.querySelectorAll(".tab")[1].click()')
        self.assertEqual(self.value('document.getElementById("choice-controller").value'), 'pi')
        self.assertEqual(self.value('document.getElementById("option-plant-friction_profile").selectedOptions[0].textContent'),
                         'grip halves from 4 to 6 m of braking')
        self.assertEqual(self.browser.said, [])

    def test_files_are_those_of_the_program(self):
        self.lab()
        self.open('#' + words_of(**{'control.adaptive.gamma': 60, 'plant.theta_N': 31.5, 'experiment.cut': 'peak',
                                    'plant.friction_profile': 'braking distance: 1; 0.4 at 5'}))
        self.value('document.getElementById("save-csv").click()')
        page = self.downloaded('run-1.csv').read_bytes()
        line = self.value('document.getElementById("line-simulator").value')
        self.assertEqual(self.program(line), page)
        self.value('document.getElementById("save-experiment").click()')
        file = self.downloaded('lab-experiment.toml')
        self.assertIn('"control.adaptive.gamma" = 60', file.read_text())
        self.assertNotIn('plant.', file.read_text().split('[settings]')[1])
        kept = re.sub(r' --set control\S+| --controller \S+', '', line).replace('--experiment paper', f'--experiment {file}')
        self.assertEqual(self.program(kept), page)
        rig = self.value('document.getElementById("line-rig").value')
        self.assertIn('--backend rig --model paper-table1', rig)
        self.assertNotRegex(rig, r'plant\.|start_speed')

    def test_an_experiment_of_ones_own(self):
        self.lab()
        self.open('#' + words_of())
        own = self.folder / 'mine.toml'

        def give(text):
            own.write_text(text)
            root = self.browser.call('DOM.getDocument')['root']['nodeId']
            field = self.browser.call('DOM.querySelector', nodeId=root, selector='#own-experiment')['nodeId']
            self.after(lambda: self.browser.call('DOM.setFileInputFiles', nodeId=field, files=[str(own)]))
        give('[[phase]]\nname = "brake"\nbrake = 2\n')
        self.assertRegex(self.value('document.getElementById("problem").textContent'), r'mine\.toml:3')
        give('[[phase]]\nname = "pull"\nbrake = "controller"\nuntil = { lasts_s = 0.7 }\n')
        self.assertEqual(self.value('document.getElementById("problem").textContent'), '')
        self.assertIn('phasepull', self.value('document.getElementById("why").textContent'))
        line = self.value('document.getElementById("line-simulator").value')
        self.assertIn('--experiment mine.toml', line)
        self.value('document.getElementById("save-csv").click()')
        self.assertEqual(self.program(line), self.downloaded('run-1.csv').read_bytes())
        self.assertEqual(self.browser.said, [])

    def test_curves_are_the_programs_rows(self):
        self.lab()
        self.open('#' + words_of() + '&&' + words_of(**{'control.rate_Hz': 500}).replace('adaptive', 'pi'))
        for run in (0, 1):
            self.value(f'document.querySelectorAll(".tab")[{run}].click()')
            self.program(self.value('document.getElementById("line-simulator").value'))
            rows = self.rows_of('program.csv')
            for chart, columns in {'slip': ['slip', 'slip_ref'], 'torque': ['brake_torque_Nm', 'brake_torque_ref_Nm'],
                                   'speeds': ['omega1_rad_s', 'omega2_rad_s'], 'distance': ['distance_m']}.items():
                for place, column in enumerate(columns):
                    drawn = self.value(f'window.lab.then(({{figures}}) => {{ const {{plot}} = figures.charts.find(({{id}}) => id === '
                                       f'"{chart}"); const y = plot.data[1 + {run * len(columns) + place}]; '
                                       'return plot.data[0].map((x, n) => [x, y[n]]).filter((pair) => pair[1] != null); })')
                    said = [[round(float(row['time_s']), 6), float(row[column])] for row in rows if row[column] != 'NaN']
                    self.assertTrue(drawn == said, (run, column, len(drawn), len(said)))
        self.assertEqual(self.browser.said, [])

    def rows_of(self, name):
        with open(self.folder / name, newline='') as file:
            return list(csv.DictReader(file))

    def test_runs_beside_each_other(self):
        self.lab()
        self.open()
        for count in (2, 3):
            self.after(lambda: self.value('document.getElementById("add-run").click()'))
            self.assertEqual(len(self.figures()['stop time, s']), count)
        self.assertIsNone(self.value('document.getElementById("add-run")'))
        self.after(lambda: self.value('''(() => { const field = document.getElementById("choice-controller");
            field.value = "sliding-mode"; field.dispatchEvent(new Event("change")); })()'''))
        times = self.figures()['stop time, s']
        self.assertEqual(times[0], times[1])
        self.assertNotEqual(times[0], times[2])
        self.assertTrue(self.value('!!document.getElementById("option-control-sliding_mode-gain_m_s2")'), 'its own options')
        self.after(lambda: self.value('document.getElementById("remove-run").click()'))
        self.assertEqual(len(self.figures()['stop time, s']), 2)
        self.assertEqual(self.browser.said, [])

    def test_a_refused_value_says_the_range_and_keeps_the_figures(self):
        self.lab()
        self.open()
        before = self.figures()
        self.set_field('plant.theta_N', -3)
        problem = self.value('document.getElementById("problem").textContent')
        self.assertRegex(problem, r'run 1: .*theta_N.*\(0, 500\]')
        self.assertEqual(self.figures(), before)
        self.set_field('plant.theta_N', 23)
        self.assertTrue(self.value('document.getElementById("problem").hidden'))
        self.open('#' + words_of().replace('adaptive', 'nobody') + '&&' + words_of())
        self.assertRegex(self.value('document.getElementById("problem").textContent'), r'run 1: .*"nobody".*adaptive')
        self.assertEqual(self.browser.said, [])

    def test_why_follows_moment_and_pointer(self):
        self.lab()
        self.open()

        def why():
            return dict(self.value('''[...document.querySelectorAll("#why tr")].map((line) =>
                [line.children[0].textContent, line.children[1].textContent])'''))
        self.value('document.getElementById("moment").focus()')
        self.press('End')
        self.assertEqual(why()['phase'], 'stopped')
        self.assertIn('both wheels stand still', why()['why this phase'])
        self.press('Home')
        self.assertEqual(why()['phase'], 'brake')
        left, top, width, height = self.value('''(() => { const r = document.querySelector("#plot-torque .u-over")
            .getBoundingClientRect(); return [r.left, r.top, r.width, r.height]; })()''')
        self.browser.mouse('mouseMoved', left + 0.4 * width, top + 0.5 * height)
        self.browser.mouse('mouseMoved', left + 0.41 * width, top + 0.5 * height)
        self.browser.wait_for('!/^at 0 s/.test(document.querySelector("#why th").textContent)', 'the pointer')
        self.assertRegex(why()['torque asked for, N m'], r'^\d\.\d')
        self.assertIn('zeta_N', why(), "the controller's own signals")
        self.assertIn('rotate', self.value('document.getElementById("wheel-upper").getAttribute("transform")'))

    def test_why_names_what_the_gate_did(self):
        self.lab()
        from_standstill = {'gate.overspeed_rad_s': 100, 'gate.fault_brake_duty': 0.5, 'gate.brake_rate_per_s': 5}
        self.open('#' + '&&'.join([words_of(**{'gate.brake_rate_per_s': 40}), words_of(**from_standstill).replace('=170', '=0'),
                                   words_of(**{'gate.motor_duty_max': 0.4}).replace('=170', '=0')]))
        actions, *runs = self.value('''window.lab.then(({engine: {tables}, state}) => [tables.gate_actions,
            ...state.results.map(({gate, summary}) => [[...gate], summary.gate])])''')
        for gate, counted in runs:
            self.assertEqual({name: sum(cycle >> bit & 1 for cycle in gate) for bit, name in enumerate(actions)}, counted)
        page = (self.folder / 'lab.html').read_text()
        self.assertEqual([action for action in actions if f'\n  {action}: (' not in page], [], 'actions without words')
        self.value('document.getElementById("whole").click()')
        for run, action, wanted in ((0, 'passed', 'passed'), (0, 'brake_rate_limited', 'held the rise of the brake duty to 40 /s'),
                                    (1, 'refused', r'.* -> fault: wheel speed above the limit.*'),
                                    (1, 'brake_rate_limited', r'.*above the limit.*; held the rise of the brake duty to 5 /s'),
                                    (2, 'motor_clamped', r'kept the motor duty between 0 and 0\.4'),
                                    (2, 'refused', r'.*phase exceeded its time limit.*')):
            self.value(f'document.querySelectorAll(".tab")[{run}].click()')
            row = next(row for row, cycle in enumerate(runs[run][0]) if cycle >> actions.index(action) & 1)
            said = self.value(f'''(() => {{ const slider = document.getElementById("moment");
                slider.value = +slider.min + {row} * slider.step; slider.dispatchEvent(new Event("input"));
                return [...document.querySelectorAll("#why tr")].find(({{children}}) => children[0].textContent === "gate")
                    .children[{run + 1}].textContent; }})()''')
            self.assertRegex(said, f'^{wanted}$', (run, action, row))
        self.assertEqual(self.browser.said, [])

    def test_the_wheels_turn_and_stop(self):
        self.lab()
        self.open()
        turned = 'document.getElementById("wheel-upper").getAttribute("transform")'
        before = self.value(turned)
        self.value('document.getElementById("play").click()')
        self.browser.wait_for(f'{turned} !== {before!r}', 'a turn')
        self.value('document.getElementById("moment").focus()')
        self.press('ArrowRight')  # who looks at a moment stops them
        still = self.value(turned)
        self.value('new Promise((done) => setTimeout(done, 200))')
        self.assertEqual(self.value(turned), still)

    def test_readers_of_the_screen_and_both_themes(self):
        self.lab()
        for scheme, background in (('light', 'rgb(246, 247, 249)'), ('dark', 'rgb(18, 23, 29)')):
            self.open(scheme=scheme)
            self.assertEqual(self.value('getComputedStyle(document.body).backgroundColor'), background)
            picture = base64.b64decode(self.browser.call('Page.captureScreenshot')['data'])
            self.assertGreater(len(picture), 50_000, 'an empty page')
            if (kept := os.environ.get('ABS_HIL_SCREENSHOTS')):
                pathlib.Path(kept, f'lab-{scheme}.png').write_bytes(picture)
        nodes = self.browser.call('Accessibility.getFullAXTree')['nodes']
        named = [(node['role']['value'], node.get('name', {}).get('value', '')) for node in nodes if not node['ignored']]
        for role in ('main', 'banner', 'contentinfo', 'table', 'slider', 'combobox', 'spinbutton'):
            self.assertIn(role, [found for found, _ in named])
        self.assertEqual([pair for pair in named if pair[0] in ('slider', 'combobox', 'spinbutton', 'button', 'textbox',
                                                                'checkbox', 'image', 'img') and not pair[1]], [])
        self.assertTrue(any(role in ('image', 'img') and re.search(r'Slip.*run 1: .* to ', name) for role, name in named), named)
        self.assertEqual(self.browser.said, [])

    def test_a_narrow_screen_has_no_sideways_scroll(self):
        self.lab()
        self.open(width=400, height=900)
        self.assertLessEqual(self.value('document.documentElement.scrollWidth'), 400)

    def test_an_exercise_hides_what_it_hides(self):
        self.lab('--exercise', 'nominal-unknown-tyre')
        self.open()
        text = (self.folder / 'lab.html').read_text()
        self.assertFalse('33.5' in text)
        task = self.value('document.getElementById("task").textContent').splitlines()
        self.assertEqual([line[:2] for line in task[1:]], ['', '1.', '2.', '3.'])
        self.assertIsNone(self.value('document.getElementById("option-plant-theta_N")'))
        self.assertNotIn('33.5', self.value('document.body.innerText + location.hash + document.getElementById("line-simulator").value'))
        self.assertNotIn('theta at 3 m/s, N', self.figures())
        self.assertIn('not yet', self.value('document.getElementById("goals").textContent'))
        self.set_field('control.nominal.theta0_N', 34)
        self.assertIn('✓ reached', self.value('document.getElementById("goals").textContent'))
        self.value('document.getElementById("save-csv").click()')
        header, first = self.downloaded('run-1.csv').read_text().splitlines()[:2]
        self.assertNotIn('theta_N', header.split(','))
        self.assertEqual(len(header.split(',')), len(first.split(',')))
        # A link cannot take the place of what is hidden.
        reached = self.figures()
        self.open(self.value('location.hash') + '&plant.theta_N=23')
        self.assertEqual(self.figures(), reached)
        self.assertNotIn('plant.theta_N', self.value('document.getElementById("line-simulator").value + location.hash'))
        self.assertEqual(self.browser.said, [])

    def test_every_exercise_can_be_done_and_is_not_done_at_first(self):
        answers = {'nominal-unknown-tyre': {'control.nominal.theta0_N': 34}, 'slip-of-the-peak': {'control.slip_ref': 0.115},
                   'break-the-sliding-mode': {'plant.c31_per_s': 12, 'plant.brake_dead_time_s': 0.05}}
        ready = {path.stem for path in (pathlib.Path(__file__).parents[2] / 'python/abs_hil/lab/exercises').glob('*.toml')}
        self.assertEqual(set(answers), ready)
        for name, answer in answers.items():
            self.lab('--exercise', name)
            self.open()
            self.assertNotIn('✓', self.value('document.getElementById("goals").textContent'), name)
            for key, value in answer.items():
                self.set_field(key, value)
            self.assertNotIn('○', self.value('document.getElementById("goals").textContent'), name)
        self.assertEqual(self.browser.said, [])

    @unittest.skipUnless(os.environ.get('ABS_HIL_MEASURE'), 'a measurement, on demand: ABS_HIL_MEASURE=1')
    def test_measure(self):
        """Prints the time to the first figure, and from a slider's change to its figures on the screen."""
        self.lab()
        for title, link in (('one run', '#' + words_of()), ('three runs', '#' + '&&'.join([words_of()] * 3)),
                            ('one run from standstill', '#' + words_of().replace('=170', '=0'))):
            self.open(link)
            first = self.value('performance.getEntriesByName("first figure")[0].startTime')
            times = self.value('''(async () => { const slider = document.querySelector("input[aria-label=\\"plant.theta_N\\"]");
                const times = []; const frame = () => new Promise(requestAnimationFrame);
                for (let place = 300; place < 700; place += 10) { const before = document.body.dataset.drawn; slider.value = place;
                  const start = performance.now(); slider.dispatchEvent(new Event("input"));
                  while (document.body.dataset.drawn === before) await frame();
                  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
                  times.push(performance.now() - start); }
                return times.sort((a, b) => a - b); })()''')
            print(f'{title}: first figure after {first:.0f} ms; a change on the screen after {times[len(times) // 2]:.0f} ms '
                  f'(median), {times[-1]:.0f} ms at most', flush=True)


if __name__ == '__main__':
    unittest.main(verbosity=2)
