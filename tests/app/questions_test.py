"""Phases that ask a person: at a terminal, without one, in virtual time and on an emulated rig's behalf."""
import os
import pty
import subprocess
import time
import unittest

from program import PATIENT, PROGRAM, ProgramTest

ASKS = '''
[[phase]]
name = "lift"
ask = "Lift the wheel, then press Enter."
wheels_apart = true
at_most_s = {limit_s}
[[phase]]
name = "run-out"
wheels_apart = true
until = {{ lasts_s = 0.1 }}
'''


class Questions(ProgramTest):
    def script(self, limit_s=20):
        path = self.folder / 'asks.toml'
        path.write_text(ASKS.format(limit_s=limit_s))
        return path

    def start(self, *args):
        """A run in real time at a terminal of its own; returns it and the terminal."""
        master, slave = pty.openpty()
        self.addCleanup(os.close, master)
        program = subprocess.Popen([PROGRAM, *PATIENT, '--no-lcm', *map(str, args)], stdin=slave, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        os.close(slave)
        self.addCleanup(self.end, program)
        return program, master

    def end(self, program):
        if program.poll() is None:
            program.kill()
        program.communicate()

    def read_until(self, program, text):
        seen = ''
        while text not in seen:
            line = program.stderr.readline()
            self.assertTrue(line, seen)
            seen += line
        return seen

    def test_enter_ends_the_phase(self):
        log, csv = self.folder / 'run.lcmlog', self.folder / 'run.csv'
        program, terminal = self.start('--experiment', self.script(), '--csv', csv, '--log', log)
        os.write(terminal, b'\n')  # before the question: it answers nothing
        self.read_until(program, 'Lift the wheel, then press Enter.')
        time.sleep(0.3)
        self.assertIsNone(program.poll())
        os.write(terminal, b'\n')
        _, errors = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, errors)
        rows = self.rows(csv)
        asking = [row for row in rows if row['phase_name'] == 'lift']
        self.assertGreater(len(asking), 200)
        self.assertTrue(all(float(row['motor_pwm']) == float(row['brake_pwm']) == 0 for row in asking))
        self.assertTrue(all(row['wheels_apart'] == '1' for row in rows))
        result = self.run_program('replay', '--check', log)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def test_nobody_answers(self):
        summary = self.folder / 'summary.json'
        program, _ = self.start('--experiment', self.script(limit_s=0.3), '--summary', summary)
        _, errors = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 1, errors)
        self.assertIn("nobody answered the phase's question in time", self.summary(summary)['reason'])

    def test_a_simulation_without_a_terminal_answers_itself(self):
        for args in (('--fast',), ()):
            with self.subTest(args):
                csv = self.folder / 'run.csv'
                result = self.patient('--no-lcm', *args, '--experiment', self.script(), '--csv', csv,
                                          stdin=subprocess.DEVNULL)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual(result.stderr.count('answers the questions of experiment'), 1, result.stderr)
                self.assertEqual(len([row for row in self.rows(csv) if row['phase_name'] == 'lift']), 1)

    def test_refused_if_nobody_could_answer(self):
        for args in (('--backend', 'rig'), ('--set', 'experiment.answers=person')):
            with self.subTest(args):
                result = self.run_program('--no-lcm', *args, '--experiment', self.script(), stdin=subprocess.DEVNULL)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn('stdin is no terminal and remote commands are not enabled', result.stderr)
        result = self.run_program('--no-lcm', '--fast', '--set', 'experiment.answers=person', '--experiment',
                                  self.script())
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('cannot wait', result.stderr)
        itself = '--no-lcm', '--backend', 'rig', '--set', 'experiment.answers=itself', '--experiment', self.script()
        for args, words in ((itself, 'weakens the protection'),
                            ((*itself, '--set', 'unsafe.keys=experiment.answers'), 'only a person')):
            result = self.run_program(*args)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(words, result.stderr)

    def test_identification_on_every_plant(self):
        for plant in ('paper-table1', 'paper-timing', 'inteco-manual'):
            with self.subTest(plant):
                out = self.folder / plant
                self.fast('--plant', plant, '--experiment', 'identification', '--out', out)
                folders = sorted(out.glob('run-*'))
                self.assertEqual(len(folders), 6)
                lifted = self.rows(folders[0] / 'run.csv')
                self.assertEqual({row['wheels_apart'] for row in lifted}, {'0', '1'})
                locked = self.rows(folders[2] / 'run.csv')
                self.assertEqual(max(float(row['slip']) for row in locked if row['phase'] == 'brake'), 1.0)
                duties = [float(row['brake_pwm']) for row in self.rows(folders[1] / 'run.csv')]
                self.assertGreater(len({duty for duty in duties if 0.40 < duty < 0.43}), 100)

    def test_validate_shows_every_experiment_of_a_series(self):
        result = self.run_program('validate', 'identification')
        self.assertEqual(result.returncode, 0, result.stderr)
        for text in ('lifted: run up', 'coast-down: accelerate', 'wheels apart', 'until a person has answered: "Lift'):
            self.assertIn(text, result.stdout)
        nested = self.folder / 'nested.toml'
        nested.write_text('[series]\nexperiments = ["paper", "series-of-ten"]\n')
        for args in (('validate', nested), ('--fast', '--no-lcm', '--experiment', nested)):
            result = self.run_program(*args)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn('series-of-ten is a series, too', result.stderr)


if __name__ == '__main__':
    unittest.main()
