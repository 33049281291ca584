"""abs_report on runs of abs_hil: the page's content, also for broken, incomplete and hostile runs."""
import base64
import csv
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import unittest

from page_reader import PageReader, unpacked
from program import ABS_HIL, ABS_REPORT, ReportTest

# of runs with the controller adaptive, which reports signals of its own
FIGURES = ['braking', 'profile', 'fig5', 'fig6', 'fig7', 'fig8', 'fig9', 'fig10', 'signals']
TRUTH = ('omega1_rad_s', 'omega2_rad_s', 'slip', 'brake_torque_Nm', 'theta_N')


def brightness(colour):
    return sum(int(colour[at:at + 2], 16) for at in (1, 3, 5)) / 765


class Page(ReportTest):
    def test_two_runs(self):
        a = self.make_run('a', '--controller', 'adaptive')
        b = self.make_run('b', '--controller', 'sliding-mode')
        page, _ = self.page(a, b)
        read = PageReader(page)
        self.assertEqual(list(read.figures), FIGURES)
        summaries = [self.summary(a), self.summary(b)]
        for run, summary in enumerate(summaries, 1):
            self.assertEqual(read.cell('metrics', 'stop time / s', run), f'{summary["stop_time_s"]:.3f}')
            self.assertEqual(read.cell('metrics', 'stop distance / m', run), f'{summary["stop_distance_m"]:.2f}')
            self.assertEqual(read.cell('metrics', 'slip RMS error', run), f'{summary["slip_rms"]:.4f}')
        change = 100.0 * (summaries[1]['stop_time_s'] / summaries[0]['stop_time_s'] - 1.0)
        self.assertEqual(read.cell('metrics', 'stop time / s', 3), f'{change:+.1f} %'.replace('-', '−'))
        differences = {line[0]: line[1:] for line in read.tables['differences'][1:]}
        self.assertEqual(differences, {'control.controller': ['adaptive', 'sliding-mode']})

    def test_only_the_pages_own_scripts_may_run_and_nothing_is_fetched(self):
        read = PageReader(self.page(self.make_run('a'))[0])
        self.assertEqual([kind for kind, _ in read.scripts], ['application/gzip', 'application/gzip', ''])
        hashes = [base64.b64encode(hashlib.sha256(data).digest()).decode()
                  for data in (unpacked(read.scripts[1][1]), read.scripts[2][1].encode())]
        self.assertEqual(read.policy, "default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
                         "form-action 'none'; script-src " + ' '.join(f"'sha256-{value}'" for value in hashes))
        for tag in ('link', 'img', 'iframe', 'object', 'base', 'form'):
            self.assertNotIn(tag, read.elements)

    def test_runs_are_called_by_what_differs_in_them_and_no_two_alike(self):
        def labels(*runs):
            found = PageReader(self.page(*runs)[0])
            self.assertEqual(found.tables['metrics'][-1][1:1 + len(runs)], [run.name for run in runs])
            return found.tables['metrics'][0][1:1 + len(runs)]
        one, other, third = (self.make_run(f'2026-01-01T00-00-0{n}', '--set', f'control.adaptive.gamma={gamma}')
                             for n, gamma in enumerate((80, 60, 60)))
        pi = self.make_run('pi-run', '--controller', 'pi')
        self.assertEqual(labels(one, other), ['gamma=80', 'gamma=60'])
        self.assertEqual(labels(one, pi), ['adaptive, gamma=80', 'pi'])
        self.assertEqual(labels(one, other, third), ['gamma=80', *(f'gamma=60, {run.name}' for run in (other, third))])
        self.assertEqual(labels(other, third), [other.name, third.name], 'nothing but the folder differs')
        step = self.make_run('steps', '--experiment', 'brake-step')
        self.assertEqual(labels(one, step), ['paper, gamma=80', 'brake-step, gamma=21'])
        for name, seed in ((other, 2), (third, 3)):
            summary = self.summary(name)
            summary['config']['run']['seed'] = seed
            (name / 'summary.json').write_text(json.dumps(summary))
        self.assertEqual(labels(other, third), ['seed=2', 'seed=3'])

    def test_figures_are_numbered_named_and_described(self):
        read = PageReader(self.page(self.make_run('a'))[0])
        self.assertEqual(list(read.headings), FIGURES)
        self.assertEqual(list(read.headings.values())[:3], ['Figure 1: Braking.', 'Figure 2: Time history of the run.',
                                                           'Figure 3: Upper wheel speed (the paper’s figure 5).'])
        distance = read.curve('fig10', 'a', 1)['xy']
        self.assertIn(f'distance, adaptive: 0 to {distance[-1][1]:.3g} m', read.alternatives['fig10'])
        for plot in read.plots.values():
            for trace in plot['data']:
                self.assertNotIn('undefined', trace.get('hovertemplate', ''))
        units = {figure: read.plots[figure]['data'][0]['hovertemplate'].split('}')[1].strip() for figure in FIGURES[:-1]}
        self.assertEqual(units, {'braking': 'rad/s', 'profile': 'rad/s', 'fig5': 'rad/s', 'fig6': 'rad/s', 'fig7': '', 'fig8': 'N m',
                                 'fig9': 'N', 'fig10': 'm'})

    def test_each_colour_has_one_for_dark_screens(self):
        read = PageReader(self.page(self.make_run('a'), self.make_run('b', '--controller', 'locked'))[0])
        light = {colour for colour in re.findall(r'"(#[0-9a-fA-F]{6})"', json.dumps(read.plots)) if brightness(colour) > 0.8}
        self.assertGreater(len(light), 3, 'the phases')
        for colour in light:
            self.assertLess(brightness(read.dark[colour]), 0.3, colour)
        for colour in ('#000000', '#1a1a1a'):
            self.assertGreater(brightness(read.dark[colour]), 0.8)

    def test_each_pulse_of_braking_has_its_own_figures_of_merit(self):
        run = self.make_run('pulses', '--experiment', 'pulses')
        page, _ = self.page(run)
        read = PageReader(page)
        names = [line[0] for line in read.tables['phases'][1:]]
        self.assertEqual(names, ['1: pulses-fast', '2: pulses-fast, pulse 2', '3: pulses-fast, pulse 3',
                                 '4: pulses-medium', '5: pulses-medium, pulse 2', '6: pulses-medium, pulse 3',
                                 '7: pulses-slow', '8: pulses-slow, pulse 2'])
        rows = self.rows(run)
        pulses = []  # a brake that was off, or another phase, begins one
        for before, row in zip(rows, rows[1:]):
            if row['phase'] == 'brake':
                if row['phase_name'] != before['phase_name'] or float(row['brake_pwm']) > 0 == float(before['brake_pwm']):
                    pulses.append([])
                pulses[-1].append(row)
        self.assertEqual(len(pulses), len(names))
        for line, own in zip(read.tables['phases'][1:], pulses):
            cell = dict(zip(read.tables['phases'][0], line))
            self.assertEqual(cell['start of braking / s'], f'{float(own[0]["time_s"]):.3f}')
            torques = [float(row['brake_torque_ref_Nm']) for row in own]
            self.assertEqual(cell['torque variation / (N m)'],
                             f'{sum(abs(b - a) for a, b in zip(torques, torques[1:])):.1f}')
            judged = [float(row['slip']) for row in own if float(row['omega2_rad_s']) * 0.099 > 3.0]
            self.assertEqual(cell['largest slip'], f'{max(judged):.4f}')
        last, begin = dict(zip(read.tables['phases'][0], read.tables['phases'][-1])), pulses[-1][0]
        stopped = next(row for row in rows if float(row['time_s']) > float(begin['time_s']) and float(row['omega2_rad_s']) * 0.099 < 0.3)
        self.assertAlmostEqual(float(last['stop distance / m']), float(stopped['distance_m']) - float(begin['distance_m']), delta=0.02)
        self.assertNotIn('phases', PageReader(self.page(self.make_run('a'))[0]).tables)

    def test_two_runs_take_less_than_3_MB(self):
        page, _ = self.page(self.make_run('a'), self.make_run('b', '--controller', 'sliding-mode'))
        self.assertLess(len(page.encode()), 3_000_000)

    def test_runs_of_several_experiments_are_named(self):
        a, b = self.make_run('a'), self.make_run('b', '--experiment', 'brake-step')
        self.assertIn('3 runs, experiments paper, brake-step</p>', self.page(a, b, a)[0])

    def test_the_strip_of_phases_names_its_run_only_beside_another(self):
        one, other = self.make_run('a-name-longer-than-the-margin'), self.make_run('b')
        names = [PageReader(self.page(*runs)[0]).plots['profile']['layout']['yaxis2']['ticktext']
                 for runs in ((one, other), (one,))]
        self.assertEqual(names, [['a-name-longer-th…', 'b'], ['']])

    def test_a_label_stands_everywhere_for_the_runs_name(self):
        a, b = self.make_run('a'), self.make_run('b')
        page, _ = self.page(a, b, '--label', 'first', '--label', 'second <b>')
        read = PageReader(page)
        self.assertEqual(read.tables['metrics'][0], ['', 'first', 'second <b>', 'second relative to first'])
        self.assertEqual({line[1] for line in read.tables['events'][1:]}, {'first', 'second <b>'})
        self.assertEqual(read.plots['profile']['layout']['yaxis2']['ticktext'], ['first', 'second &lt;b&gt;'])
        self.assertIn('the phases of first:', page)
        self.assertEqual({curve['name'] for curve in read.figures['fig5']}, {'first', 'second &lt;b&gt;'})

    def test_own_names_of_phases_stand_in_strips_figures_and_events(self):
        """Two phases of one kind: only the experiment's own names tell them apart."""
        experiment = self.folder / 'steps.toml'
        experiment.write_text('[[phase]]\nname = "brake-low"\nbrake = { slip_ref = 0.05 }\nuntil = { lasts_s = 0.4 }\n'
                              '[[phase]]\nname = "brake-high"\nbrake = { slip_ref = 0.15 }\nuntil = { lasts_s = 0.5 }\n'
                              '[[phase]]\nname = "hold"\nuntil = { lasts_s = 0.2 }\n')
        run = self.make_run('steps', '--experiment', experiment, '--set', 'experiment.start_speed_rad_s=170')
        second = next(row for row in self.rows(run) if row['phase_name'] == 'brake-high')['time_s']
        for with_events in (True, False):
            read = PageReader(self.page(run)[0])
            self.assertEqual(read.texts('profile')[-3:], ['brake-low', 'brake-high', 'hold'])
            for figure in ('fig5', 'fig7', 'fig8', 'fig9', 'fig10', 'signals'):
                self.assertLessEqual({'brake-low', 'brake-high'}, set(read.texts(figure)), figure)
                self.assertNotIn('hold', read.texts(figure), 'its colour names it')
                marks = [shape['x0'] for shape in read.plots[figure]['layout']['shapes'] if shape['type'] == 'line']
                self.assertEqual(marks[:2], [0.0, float(second)], figure)
            phases = [line[3] for line in read.tables['events'][1:]]
            self.assertEqual(phases[:2], ['brake-low (brake)', 'brake-high (brake)'])
            self.assertEqual(phases[2], 'hold')
            if with_events:
                os.remove(run / 'events.csv')

    def test_experiments_without_own_names_show_the_kinds(self):
        read = PageReader(self.page(self.make_run('a'))[0])
        self.assertIn('brake', read.texts('profile'))
        self.assertNotIn('brake', read.texts('fig5'))
        self.assertEqual([line[3] for line in read.tables['events'][1:4]], ['idle', 'accelerate', 'coast'])

    def test_signals_of_the_controllers(self):
        a = self.make_run('a', '--controller', 'adaptive')
        b = self.make_run('b', '--controller', 'pi')
        read = PageReader(self.page(a, b)[0])
        self.assertEqual([(c['quantity'], c['run']) for c in read.figures['signals']],
                         [(name, 1) for name in ('I_m', 'omega1_hat_rad_s', 'zeta_N', 'V', 'V_dot')])
        self.assertEqual(list(PageReader(self.page(b)[0]).figures), FIGURES[:-1], 'pi has no signals')
        rows = self.rows(a)
        last = [row for row in rows if row['phase'] == 'brake'][-1]
        self.assertAlmostEqual(float(last['theta_est_N']), float(last['zeta_N']) + 21 * 7.54e-3 / 0.0995
                               * (float(last['omega1_est_rad_s']) - float(last['omega1_hat_rad_s'])), 9, '(18)')

    def test_signals_with_hostile_names_are_not_drawn(self):
        a = self.make_run('a')
        text = (a / 'run.csv').read_text()
        (a / 'run.csv').write_text(text.replace(',zeta_N,', ",<img src=x onerror=alert(1)>,", 1))
        read = PageReader(self.page(a)[0])
        self.assertEqual([c['quantity'] for c in read.figures['signals']], ['I_m', 'omega1_hat_rad_s', 'V', 'V_dot'])

    def test_the_same_page_twice(self):
        a = self.make_run('a')
        self.assertEqual(self.page(a)[0], self.page(a)[0])

    def test_csv_alone_gives_the_summarys_figures(self):
        a = self.make_run('a')
        summary = self.summary(a)
        shutil.copy(a / 'run.csv', self.folder / 'alone.csv')
        page, said = self.page(self.folder / 'alone.csv')
        self.assertIn('only a CSV file', said)
        read = PageReader(page)
        self.assertEqual(list(read.figures), FIGURES)
        for row, key, decimals in (('stop time / s', 'stop_time_s', 3), ('stop distance / m', 'stop_distance_m', 2),
                                   ('slip RMS error', 'slip_rms', 4), ('slip overshoot', 'slip_overshoot', 4),
                                   ('theta at 3 m/s / N', 'theta_final_N', 2),
                                   ('torque variation / (N m)', 'torque_total_variation_Nm', 1)):
            self.assertEqual(read.cell('metrics', row), f'{summary[key]:.{decimals}f}')

    def test_rig_run_without_truth(self):
        a = self.make_run('a')

        def forget(row):
            for column in TRUTH:
                row[column] = 'NaN'
        self.rewrite(a, forget)
        page, _ = self.page(a)
        read = PageReader(page)
        self.assertEqual(list(read.figures), FIGURES)
        self.assertEqual(read.cell('metrics', 'speeds and slip'), 'estimates')
        self.assertIn('Runs without true values show estimates from the encoders', page)
        self.assertIn('have no true θ', page)
        self.assertEqual([curve['quantity'] for curve in read.figures['fig9']], ['theta_est'])
        rows = [row for row in self.rows(a) if row['phase'] == 'brake']
        self.assertGreaterEqual(read.curve('fig7', 'a', 1)['said'], len(rows) - 2)

    def test_missing_and_broken_side_files_are_said(self):
        a = self.make_run('a')
        os.remove(a / 'events.csv')
        (a / 'environment.json').write_text('{"kernel": ')
        page, said = self.page(a)
        self.assertIn('no events.csv', said)
        self.assertIn('environment.json: not valid JSON', said)
        self.assertIn('no events.csv', page)

    def test_run_without_braking_shows_all_of_it(self):
        a = self.make_run('a')
        self.rewrite(a, lambda row: row.update(phase='coast'))
        read = PageReader(self.page(a)[0])
        self.assertEqual(list(read.figures), FIGURES)
        self.assertEqual(read.curve('fig10', 'a', 1)['run'], 1)

    def test_fault_stands_on_the_time_axis_and_in_the_table(self):
        a = self.make_run('a')

        def fault(row):
            if float(row['time_s']) > 7.0:
                row['phase'] = 'fault'
        self.rewrite(a, fault)
        events = (a / 'events.csv').read_text().splitlines()
        (a / 'events.csv').write_text('\n'.join([*events[:4], '7.0,fault,fault,"wheel speed, above the limit",251.5', '']))
        page, _ = self.page(a)
        read = PageReader(page)
        self.assertEqual([line for line in read.tables['events'] if line[2] == 'fault'],
                         [['7.000', 'adaptive', 'fault', 'fault', 'wheel speed, above the limit', '251.5']])
        self.assertEqual([c['drawn'] for c in read.figures['profile'] if c['quantity'] == 'events'], [1])
        self.assertIn('fault', read.texts('fig5'))

    def test_changes_of_the_simulated_rig_stand_on_the_time_axis(self):
        a, b = (self.make_run(name, '--experiment', 'friction-jump') for name in 'ab')
        page, _ = self.page(a)
        self.assertEqual([c['drawn'] for c in PageReader(page).figures['profile'] if c['quantity'] == 'events'], [2])
        one, two = PageReader(page), PageReader(self.page(a, b)[0])
        for label in ('friction × 0.522', 'friction × 1'):
            for figure in ('braking', *FIGURES[2:]):
                self.assertEqual(one.texts(figure).count(label), 1, label)
                self.assertEqual(two.texts(figure).count(label), 1, 'once for runs that change alike')

    def test_summary_of_another_run_is_noticed(self):
        a, b = self.make_run('a'), self.make_run('b', '--controller', 'locked')
        shutil.copy(b / 'summary.json', a / 'summary.json')
        self.assertIn('stop_time_s: the summary says', self.page(a)[1])

    def test_rows_that_miss_what_the_summary_counts_are_noticed(self):
        a = self.make_run('a', '--set', 'telemetry.decimation=10')
        self.assertNotIn('summary', self.page(a)[1])
        lines = (a / 'run.csv').read_text().splitlines(keepends=True)
        whole, cut = lines[1:], lines[1:4640]

        def said(rows, **counts):
            (a / 'run.csv').write_text(lines[0] + ''.join(rows))
            (a / 'summary.json').write_text(json.dumps({**self.summary(a), 'telemetry_drops': 0, 'csv_rows_lost': 0, **counts}))
            return self.page(a)[1]
        for words in (f'the summary counts {len(whole)} cycles but the CSV has 4639 rows', 'stop_time_s, '):
            self.assertIn(words, said(cut))
        self.assertNotIn('cycles', said(cut, telemetry_drops=1000, csv_rows_lost=len(whole) - 5639), 'the run counted them')
        self.assertIn('cycles', said(cut, csv_rows_lost=1))
        self.assertIn('cycles', said([*whole, whole[-1]]), 'more rows than cycles')
        self.assertNotIn('cycles', said(whole[::10]), 'as from its event log')

    def test_hostile_names_stay_text(self):
        a = self.make_run('a')
        name = '<img src=x onerror=alert(1)>\'"`touch pwned`$(touch pwned)&'
        hostile = self.folder / name
        a.rename(hostile)
        summary = self.summary(hostile)
        for key in ('controller', 'plant', 'experiment', 'reason', 'result', 'backend'):
            summary[key] = '</table><script>alert(1)</script>'
        summary['config']['<script>'] = '<svg onload=alert(1)>'
        (hostile / 'summary.json').write_text(json.dumps(summary))
        (hostile / 'events.csv').write_text('time_s,event,phase,reason,value\n1,<b>,<i>,"<u>",<s>\n')
        self.rewrite(hostile, lambda row: row.update(phase='<q>' if row['phase'] == 'hold' else row['phase']))
        page, _ = self.page(hostile, self.make_run('b'), '--title', '<h6>', '--figures', 'figures')
        read = PageReader(page)
        self.assertEqual(list(read.figures), FIGURES)
        self.assertEqual([kind for kind, _ in read.scripts], ['application/gzip', 'application/gzip', ''])
        for tag in ('img', 'b', 'i', 'u', 's', 'q', 'h6', 'svg'):
            self.assertEqual(read.elements.get(tag, 0), len(read.figures) if tag == 'b' else 0, tag)
        for plot in read.plots.values():  # plotly.js reads markup in these texts
            layout = plot['layout']
            shown = [note['text'] for note in layout['annotations']] + [trace['name'] for trace in plot['data']]
            shown += [text for axis in layout if axis.startswith('yaxis') for text in layout[axis].get('ticktext', [])]
            for text in shown:
                self.assertNotRegex(text, '[<>]')
        self.assertFalse((self.folder / 'pwned').exists())

    def test_paper(self):
        a, b = self.make_run('a', '--controller', 'adaptive'), self.make_run('b', '--controller', 'sliding-mode')
        read = PageReader(self.page('--paper', b, a)[0])
        self.assertEqual(list(read.figures), FIGURES[2:-1])
        ours = 100.0 * (self.summary(a)['stop_time_s'] / self.summary(b)['stop_time_s'] - 1.0)
        self.assertEqual(read.cell('claims', 'stop time, adaptive against sliding mode', 1), '−6.7 %')
        self.assertEqual(read.cell('claims', 'stop time, adaptive against sliding mode', 2),
                         f'{ours:+.1f} %'.replace('-', '−'))
        self.assertIn('--paper compares two runs', self.report('--paper', a, status=2).stderr.decode())


class Series(ReportTest):
    def test_means_over_what_was_varied(self):
        series = self.folder / 'series'
        stops = {}
        for number in range(1, 7):
            theta = (20, 23, 26)[(number - 1) % 3]
            folder = self.make_run(f'series/run-{number:04}', '--set', f'plant.theta_N={theta}', '--seed', str(number))
            stops.setdefault(theta, []).append(self.summary(folder)['stop_time_s'])
        (series / 'series.json').write_text('{}')
        (series / 'run-0007').mkdir()
        page, said = self.page(series)
        self.assertIn('run-0007 is not complete', said)
        read = PageReader(page)
        self.assertEqual(list(read.figures), ['braking', 'series1', *FIGURES[1:]])
        lines = [line for line in read.tables['series'][1:] if line[0] == 'stop time / s']
        self.assertEqual([line[1] for line in lines], ['theta_N = 20', 'theta_N = 23', 'theta_N = 26'])
        groups = read.tables['groups']
        self.assertEqual([line[0:2] for line in groups], [['group', 'runs'], ['theta_N = 20', '2'], ['theta_N = 23', '2'],
                                                          ['theta_N = 26', '2']])
        self.assertIn(f'{sum(stops[20]) / 2.0:.3f} ± ', groups[1][groups[0].index('stop time / s')])
        for line, (_, times) in zip(lines, sorted(stops.items())):
            mean = sum(times) / 2.0
            self.assertEqual(line[2:4], ['2', f'{mean:.4f}'])
            half = 12.7062 * abs(times[0] - times[1]) / 2.0  # t(0.975, 1) s / sqrt(2)
            low, high = (float(end.replace('−', '-')) for end in line[5].split(' to '))
            self.assertAlmostEqual(low, mean - half, delta=2e-4)
            self.assertAlmostEqual(high, mean + half, delta=2e-4)
        every = [c for c in read.figures['series1'] if c['quantity'] == 'stop_time_s']
        self.assertEqual([(c['said'], c['drawn']) for c in every], [(6, 6)])
        self.assertEqual(len([c for c in read.figures['fig5'] if c['quantity'] == 'omega1']), 6)
        self.assertEqual([c['name'] for c in read.figures['fig5'] if c['in_legend']], [line[0] for line in groups[1:]])


class Files(ReportTest):
    def test_link_to_nowhere_is_no_run(self):
        (self.folder / 'none' / 'x').mkdir(parents=True)
        (self.folder / 'none' / 'x').rmdir()
        (self.folder / 'none' / 'run-0001').symlink_to('nowhere')
        self.assertIn('is neither a run folder', self.report('none', status=2).stderr.decode())

    def test_report_stands_here_and_replaces_only_reports(self):
        a = self.make_run('a')
        self.report(a)
        self.assertGreater((self.folder / 'report.html').stat().st_size, 50_000)
        self.report(a)
        (self.folder / 'thesis.html').write_text('<html>years of work</html>')
        said = self.report(a, '--output', 'thesis.html', status=2).stderr.decode()
        self.assertIn('is not a report of abs_report', said)
        self.assertEqual((self.folder / 'thesis.html').read_text(), '<html>years of work</html>')
        self.report(a, '--output', 'thesis.html', '--force')

    def test_figures_as_files(self):
        a = self.make_run('a')
        for kind, magic in (('svg', b'<?xml'), ('png', b'\x89PNG'), ('pdf', b'%PDF')):
            self.report(a, '--figures', kind, '--format', kind, '--output', f'{kind}.html')
            files = {path.stem: path for path in (self.folder / kind).iterdir()}
            self.assertEqual(sorted(files), sorted(FIGURES))
            for path in files.values():
                self.assertEqual(path.read_bytes()[:len(magic)], magic)
        self.assertIn('exists', self.report(a, '--figures', 'svg', status=2).stderr.decode())

    def test_bad_input(self):
        a = self.make_run('a')
        lines = (a / 'run.csv').read_text().splitlines(keepends=True)
        broken = self.folder / 'broken.csv'
        for text, says in (
                ([], 'broken.csv: the file is empty'),
                (lines[:1], 'broken.csv:1: no rows after the header'),
                ([lines[0], lines[1][:9]], 'broken.csv:2: the only row is incomplete'),
                ([*lines[:50], 'garbage\n', *lines[50:]], 'broken.csv:51: time_s: "garbage" is not a number'),
                ([*lines[:50], *lines[20:]], 'broken.csv:51: time_s decreases'),
                (['time_s,phase\n', '0,idle\n'], 'broken.csv:1: the header lacks omega1_rad_s'),
                (['\x7fELF\x01\x01\x00' * 30_000], 'broken.csv" is no recording')):
            broken.write_text(''.join(text))
            self.assertIn(says, self.report(broken, status=2).stderr.decode())
            self.assertFalse((self.folder / 'report.html').exists())
        (self.folder / 'empty').mkdir()
        for args, says in (((self.folder / 'empty',), 'neither a run folder'), (('nowhere',), 'does not exist'),
                           ((), 'RUN'), ((a, '--window', '3:2'), '--window 3:2'), ((a, '--format', 'gif'), '--format'),
                           ((a, '--label', 'x', '--label', 'y'), '2 labels for 1 runs'),
                           ((a, '--columns', 'slip'), '--columns'), ((a, '--csv', '--columns', ','), '--columns names none'),
                           ((a, '--output', 's.csv', '--merits', './s.csv', '--force'), 'give FILE.html'),
                           ((a, '--merits', 'report.html', '--force'), 'give FILE.csv'),
                           ((a, '--window', '-1:-2'), '--window -1:-2')):
            self.assertIn(says, self.report(*args, status=2).stderr.decode())
        self.assertEqual(list(self.folder.glob('*.html')), [])
        self.report(a, '--window', '-5:1')
        said = self.report(a, '--window', '100:200', '--force', status=2).stderr.decode()
        self.assertRegex(said, r'--window 100:200 holds no row; give seconds within 0:\d')

    def test_row_cut_off_by_a_crash_is_left_out_and_said(self):
        a = self.make_run('a')
        text = (a / 'run.csv').read_text()
        (a / 'run.csv').write_text(text[:len(text) // 10 * 9])
        self.assertIn('is incomplete, as after a crash', self.page(a)[1])

    def test_plain_table_and_figures_of_merit_as_csv(self):
        runs = [self.make_run(name, '--controller', name) for name in ('adaptive', 'locked')]
        said = self.report(*runs, '--table', '--merits', 'merits.csv').stdout.decode()
        self.assertFalse((self.folder / 'report.html').exists())
        summaries = [self.summary(run) for run in runs]
        line = next(line for line in said.splitlines() if line.startswith('stop distance'))
        self.assertEqual(line.split('  ')[0], 'stop distance / m')
        self.assertEqual(line.split()[4:6], [f'{summary["stop_distance_m"]:.2f}' for summary in summaries])
        with open(self.folder / 'merits.csv', newline='') as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row['run'] for row in rows], ['adaptive', 'locked'])
        for row, summary in zip(rows, summaries):
            self.assertEqual(float(row['stop_time_s']), summary['stop_time_s'])
            self.assertEqual(float(row['slip_rms']), summary['slip_rms'])
        self.assertIn('exists', self.report(runs[0], '--merits', 'merits.csv', status=2).stderr.decode())

    def test_abs_hil_starts_the_programs_beside_it_or_says_what_to_install(self):
        a = self.make_run('a')
        result = subprocess.run([ABS_HIL, 'report', a, '--table'], capture_output=True, text=True, cwd=self.folder, check=True)
        self.assertIn('stop time / s', result.stdout)
        self.assertEqual(subprocess.run([ABS_HIL, 'report', 'nowhere'], capture_output=True, check=False).returncode, 2)
        said = subprocess.run([ABS_HIL, '--help'], capture_output=True, text=True, check=True).stdout
        for name in ('report', 'tune', 'learn'):
            self.assertIn(f'\n  {name} ', said)
        alone = shutil.copy(ABS_HIL, self.folder / 'abs_hil')
        result = subprocess.run([alone, 'tune', '--help'], capture_output=True, text=True, check=False,
                                env={'PATH': str(self.folder)})
        self.assertEqual(result.returncode, 3)
        self.assertIn('python3-abs-hil', result.stderr)

    def test_a_value_beyond_single_precision(self):
        a = self.make_run('a', '--set', 'experiment.start_speed_rad_s=60')
        rows = iter(range(10 ** 6))
        self.rewrite(a, lambda row: row.update(brake_torque_Nm='1e308', slip_ref='-1e308') if next(rows) == 50 else None)
        self.assertNotIn('Warning', self.page(a, '--figures', self.folder / 'figures')[1])

    def test_nothing_half_written(self):
        a = self.make_run('a')
        self.assertIn('nowhere', self.report(a, '--output', 'nowhere/x.html', status=2).stderr.decode())
        self.report(a)
        self.assertEqual([path.name for path in self.folder.iterdir() if path.name.startswith('.')], [])

    def test_mutated_files_give_a_report_or_an_error(self):
        a = self.make_run('a', '--set', 'experiment.start_speed_rad_s=60')
        generator = random.Random(2)
        for name in ('run.csv', 'summary.json', 'events.csv', 'config.toml', 'environment.json') * 3:
            whole = (a / name).read_bytes()
            data = bytearray(whole)
            for _ in range(4):
                data[generator.randrange(len(data))] = generator.randrange(256)
            (a / name).write_bytes(data)
            result = subprocess.run([ABS_REPORT, a, '--force', '--table'], capture_output=True, timeout=60, check=False,
                                    cwd=self.folder)
            self.assertIn(result.returncode, (0, 2), result.stderr)
            self.assertNotIn(b'Traceback', result.stderr)
            (a / name).write_bytes(whole)


if __name__ == '__main__':
    unittest.main()
