"""abs_report on the files beside a run's rows: timing, configuration and events, valid and broken."""
import os
import re
import subprocess
import unittest

from page_reader import PageReader
from program import ABS_HIL, ReportTest

PARTS = 5  # wake-up, read, control, write, whole cycle
HISTOGRAM_HEAD = '# abs_hil, us; columns: wake-up latency, read, control, write, whole cycle\n'


class SideFiles(ReportTest):
    def make_real_run(self, name):
        folder = self.folder / name
        subprocess.run([ABS_HIL, '--backend', 'sim', '--no-lcm', '--rt', 'off', '--set', 'realtime.cycle_gap_max_s=10', '--out', folder,
                        '--set', 'experiment.start_speed_rad_s=60'], capture_output=True, timeout=60, check=True)
        return folder

    def without_summary(self, name, *args):
        """A run without its summary: abs_report takes the content from the other files."""
        folder = self.make_run(name, *args)
        os.remove(folder / 'summary.json')
        return folder

    def test_timing_of_a_run_in_real_time(self):
        run = self.make_real_run('real')
        summary = self.summary(run)
        read = PageReader(self.page(run)[0])
        for row, key in (('wake-up latency', 'wakeup_latency_us'), ('whole cycle', 'cycle_time_us')):
            for name, quantile in (('median', 'p50'), ('99 %', 'p99'), ('99.9 %', 'p99_9'), ('greatest', 'max')):
                self.assertEqual(float(read.cell('timing', f'{row}, {name}')), round(summary[key][quantile]))
        self.assertEqual(read.cell('timing', 'cycles'), str(summary['cycles']))
        self.assertEqual(read.cell('timing', 'late cycles'), str(summary['overruns']))
        self.assertEqual(read.cell('timing', 'real time obtained'), 'no')
        # Every cycle after the first few counts once in each column of the histogram, and each column is a curve.
        measured = summary['cycles'] - summary['config']['realtime']['startup_cycles']
        lines = (run / 'histogram.txt').read_text().splitlines()
        overflows = next(line for line in lines if 'Overflows' in line).split(':')[1].split()
        bins = [line.split()[1:] for line in lines if line and line[0] != '#']
        for part in range(PARTS):
            self.assertEqual(sum(int(line[part]) for line in bins) + int(overflows[part]), measured)
        self.assertEqual(len(read.figures['timing']), PARTS)
        for curve in read.figures['timing']:
            self.assertGreater(curve['drawn'], 1, curve)

    def test_histogram_beside_a_run_whose_summary_is_lost(self):
        run = self.without_summary('a')
        # All cycles have the same duration: a single bar between the edges of one bin.
        (run / 'histogram.txt').write_text(HISTOGRAM_HEAD + '# Histogram\n000005' + '\t000100' * PARTS +
                                           '\n# Histogram Overflows: 00002 00000 00000 00000 00001\n')
        page, said = self.page(run)
        self.assertIn('no summary.json', said)
        self.assertIn('3 durations beyond', page)
        for curve in PageReader(page).figures['timing']:
            self.assertEqual(len({x for x, _ in curve['xy']}), 2, curve['xy'])

    def test_broken_histogram_is_said_with_its_line(self):
        run = self.without_summary('a')
        for text, words in (('something else\n', 'histogram.txt:1: not a histogram of abs_hil'),
                            (HISTOGRAM_HEAD + '000001\t1\t2\n', 'histogram.txt:2: not a line of a histogram'),
                            (HISTOGRAM_HEAD + '000001' + '\tx' * PARTS + '\n', 'histogram.txt:2: not a line'),
                            (HISTOGRAM_HEAD + '99999999999' + '\t1' * PARTS + '\n', 'histogram.txt:2: not a line')):
            (run / 'histogram.txt').write_text(text)
            page, said = self.page(run)
            self.assertIn(words, said)
            self.assertNotIn('timing', PageReader(page).figures)

    def test_configuration_from_the_file_is_that_of_the_summary(self):
        with_summary = [self.make_run('a'), self.make_run('b', '--set', 'plant.theta_N=30', '--seed', '2')]
        differences = PageReader(self.page(*with_summary)[0]).tables['differences'][1:]
        self.assertIn(['plant.theta_N', '30'], [[line[0], line[2]] for line in differences])
        for run in with_summary:
            os.remove(run / 'summary.json')
        self.assertEqual(PageReader(self.page(*with_summary)[0]).tables['differences'][1:], differences)

        (with_summary[0] / 'config.toml').write_text('[plant]\ntheta_N = \n')
        said = self.page(with_summary[0])[1]
        self.assertRegex(said, r'config\.toml:\d+: ')

    def test_broken_events_are_said_with_their_line_and_a_cut_off_last_one_is_left_out(self):
        run = self.make_run('a')
        events = (run / 'events.csv').read_text()
        for text, words in (('time,what\n', 'events.csv:1: the header must begin with'),
                            (events + 'soon,phase,brake,"no reason",1\n', r'events.csv:\d+: not an event: "soon'),
                            (events + '1.0,phase\n', r'events.csv:\d+: not an event: "1.0,phase"')):
            (run / 'events.csv').write_text(text)
            self.assertRegex(self.page(run)[1], words)
        (run / 'events.csv').write_text(events)
        whole = PageReader(self.page(run)[0]).tables['events']
        (run / 'events.csv').write_text(events + '7.0,fau')
        page, said = self.page(run)
        self.assertFalse(re.search(r'events\.csv:\d', said), said)
        self.assertEqual(PageReader(page).tables['events'], whole)


if __name__ == '__main__':
    unittest.main()
