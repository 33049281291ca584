"""--out: a folder with all files of a run, and the default one below runs/."""
import csv
import hashlib
import json
import os
import unittest

from program import PATIENT, ProgramTest

FILES = {'run.csv', 'run.lcmlog', 'summary.json', 'config.toml', 'environment.json', 'events.csv', 'SHA256SUMS'}


class RunFolder(ProgramTest):
    def names(self, path):
        return {entry.name for entry in path.iterdir()}

    def test_holds_the_whole_record(self):
        out = self.folder / 'deep' / 'down'
        single = self.folder / 'single.csv'
        self.fast('--experiment', 'friction-jump', '--out', out, '--csv', single)
        self.assertLessEqual(FILES, self.names(out))
        self.assertEqual((out / 'run.csv').read_bytes(), single.read_bytes())
        summary = self.summary(out / 'summary.json')
        self.assertEqual(summary['result'], 'completed')
        environment = json.loads((out / 'environment.json').read_text())
        self.assertIn('--experiment', environment['command_line'])
        for key in ('kernel', 'host', 'compiler', 'build_type', 'git_revision', 'version', 'date_utc', 'board', 'real_time'):
            self.assertIn(key, environment)
        for line in (out / 'SHA256SUMS').read_text().splitlines():
            digest, name = line.split('  ')
            self.assertEqual(hashlib.sha256((out / name).read_bytes()).hexdigest(), digest, name)
        with open(out / 'events.csv', newline='') as file:
            events = list(csv.DictReader(file))
        self.assertEqual(list(events[0]), ['time_s', 'event', 'phase', 'reason', 'value', 'phase_name'])
        self.assertEqual([e['phase'] for e in events if e['event'] == 'phase'],
                         ['idle', 'accelerate', 'coast', 'brake', 'hold', 'stopped'])
        for event in events:  # 8.549, not 8.549000000000001
            self.assertRegex(event['time_s'], r'^\d+(\.\d{1,6})?$')

    def test_its_configuration_gives_the_same_run(self):
        first, second = self.folder / 'first', self.folder / 'second'
        self.fast('--plant', 'inteco-manual', '--controller', 'pi', '--seed', 5, '--set', 'experiment.idle_s=0.125',
                  '--out', first)
        self.fast('--config', first / 'config.toml', '--plant', 'inteco-manual', '--out', second)
        for name in ('config.toml', 'run.csv', 'events.csv', 'run.lcmlog'):
            self.assertEqual((first / name).read_bytes(), (second / name).read_bytes(), name)

    def test_nothing_is_overwritten(self):
        out = self.folder / 'out'
        out.mkdir()
        (out / 'mine').write_text('mine')
        result = self.run_program('--fast', '--no-lcm', '--out', out)
        self.assertEqual(result.returncode, 2)
        self.assertIn('not empty', result.stderr)
        self.assertEqual(self.names(out), {'mine'})

    def test_a_fault_is_recorded_too(self):
        out = self.folder / 'out'
        result = self.run_program('--fast', '--no-lcm', '--set', 'experiment.accelerate_limit_s=1', '--out', out)
        self.assertEqual(result.returncode, 1)
        self.assertIn('fault,fault,"phase exceeded its time limit"', (out / 'events.csv').read_text())
        self.assertEqual(self.summary(out / 'summary.json')['result'], 'fault')

    def test_default_folder(self):
        short = [*PATIENT, '--no-lcm', '--rt', 'off', '--set', 'experiment.start_speed_rad_s=20']
        runs = self.folder / 'runs'
        env = {**os.environ, 'ABS_HIL_RUNS_DIR': str(runs)}
        for extra in (['--fast'], ['--no-out'], ['--csv', self.folder / 'x.csv']):
            self.assertEqual(self.run_program(*short, *extra, env=env).returncode, 0)
            self.assertFalse(runs.exists(), extra)
        self.assertEqual(self.run_program(*short, env=env).returncode, 0)
        only, = runs.iterdir()
        self.assertTrue(only.name.endswith('-paper'))
        self.assertLessEqual(FILES | {'histogram.txt'}, self.names(only))

    def test_a_default_folder_that_cannot_be_made_stops_nothing(self):
        place = self.folder / 'file'
        place.write_text('')
        result = self.run_program('--no-lcm', '--rt', 'off', '--set', 'experiment.start_speed_rad_s=20',
                                  env={**os.environ, 'ABS_HIL_RUNS_DIR': str(place / 'runs')})
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('leaves no run folder', result.stderr)


if __name__ == '__main__':
    unittest.main()
