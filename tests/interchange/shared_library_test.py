"""Controllers from shared libraries: the example in C against `pi`, and libraries that misbehave. usage: see foreign.py"""
import os
import struct
import unittest

from foreign import broken, example  # first: it reads the arguments

from program import ProgramTest

BRAKE = ['--set', 'experiment.start_speed_rad_s=170']


class SharedLibraryTest(ProgramTest):
    def broken(self, kind):
        return broken(self.folder, kind)

    def example(self):
        return example(self.folder)

    def stop(self, controller, *options):
        summary = self.folder / 'summary.json'
        self.fast('--controller', controller, '--summary', summary, *options)
        return self.summary(summary)

    def refused(self, library, *words, code_ran=False, options=('--fast', '--no-lcm')):
        """Exit status 2 and one line with these words. code_ran: the library's constructor, in its own process."""
        trace = self.folder / 'trace'
        result = self.run_program('--controller', library, *options, env={**os.environ, 'ABS_HIL_TRACE': str(trace)})
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
        for word in (str(library), *words):
            self.assertIn(str(word), result.stderr)
        self.assertNotIn('rig_environment', result.stderr)
        self.assertEqual(trace.exists(), code_ran)

    def test_the_example_stops_as_pi_does(self):
        library = self.example()
        for options in ([], ['--set', 'control.pi.kp_per_s=20', '--set', 'control.pi.ki_per_s2=200'],
                        ['--set', 'plant.ideal_sensors=true', '--set', 'plant.ideal_actuator=true']):
            with self.subTest(options=options):
                ours, its = self.stop('pi', *options), self.stop(library, *options)
                self.assertAlmostEqual(its['stop_distance_m'] / ours['stop_distance_m'], 1.0, delta=0.01)
                self.assertAlmostEqual(its['stop_time_s'] / ours['stop_time_s'], 1.0, delta=0.01)
                self.assertEqual(its['foreign_controller']['file'], str(library))
                self.assertGreater(its['foreign_controller']['steps'], 1000)

    def test_its_signal_is_a_column(self):
        csv = self.folder / 'run.csv'
        self.fast('--controller', self.example(), '--csv', csv, *BRAKE)
        values = [float(row['integral_m']) for row in self.rows(csv) if row['phase'] == 'brake']
        self.assertGreater(len(values), 1000)
        self.assertTrue(all(value == value for value in values[:1000]))

    def test_what_cannot_fit_is_refused_before_it_runs(self):
        self.refused(self.broken('VERSION'), 'version 7', code_ran=True)
        self.refused(self.broken('SIZE'), 'abs_hil_input has 112 bytes', '120', code_ran=True)
        self.refused(self.broken('MAGIC'), 'abs_hil_controller_interface', code_ran=True)
        self.refused(self.broken('NO_INTERFACE'), 'does not define abs_hil_controller_interface', code_ran=True)
        self.refused(self.broken('NO_STEP'), 'does not define abs_hil_controller_step', code_ran=True)

    def test_what_refuses_or_dies_while_it_is_made(self):
        self.refused(self.broken('REFUSES'), 'no licence for this rig', code_ran=True)
        self.refused(self.broken('DIES_IN_CREATE'), 'crashed: Segmentation fault', code_ran=True)
        self.refused(self.broken('BAD_SIGNAL'), "a,b", code_ran=True)
        self.refused(self.broken('MANY_SIGNALS'), 'more than 8 signals', code_ran=True)

    def test_files_that_are_no_library(self):
        sound = self.broken('SOUND').read_bytes()
        for name, data, word in (
                ('empty', b'', 'not a shared library'), ('text', b'#!/bin/sh\n' * 20, 'not a shared library'),
                ('short', sound[:40], 'not a shared library'), ('half', sound[:len(sound) // 2], 'while it was loaded'),
                ('other', sound[:18] + struct.pack('<H', 183) + sound[20:], 'not a shared library'),
                ('executable', sound[:16] + struct.pack('<H', 2) + sound[18:], 'not a shared library')):
            with self.subTest(name):
                library = self.folder / f'{name}.so'
                library.write_bytes(data)
                self.refused(library, word)
        self.refused(self.folder / 'nowhere.so', 'No such file')
        # Every table of the file, pointed elsewhere: refused or run, never a crash of the program.
        for offset in range(0, len(sound), 97):
            library = self.folder / 'torn.so'
            library.write_bytes(sound[:offset] + b'\xff' * 8 + sound[offset + 8:])
            result = self.run_program('--controller', library, '--fast', '--no-lcm', *BRAKE)
            self.assertIn(result.returncode, (0, 1, 2), (offset, result.stderr))

    def test_a_crash_in_simulation_loses_nothing(self):
        for kind, words in (('DIES_IN_STEP', 'crashed: Segmentation fault in step 100'),
                            ('EXITS', 'ended its process with status 5 in step 100'), ('NOT_FINITE', 'brake_torque_Nm'),
                            ('HANGS', 'did not answer in time in step 100')):
            with self.subTest(kind):
                folder = self.folder / kind
                result = self.run_program('--controller', self.broken(kind), '--fast', '--no-lcm', '--out', folder, *BRAKE)
                self.assertEqual(result.returncode, 1, result.stderr)
                summary = self.summary(folder / 'summary.json')
                self.assertEqual(summary['result'], 'fault')
                self.assertIn(words, summary['reason'])
                rows = self.rows(folder / 'run.csv')
                self.assertEqual(sum(row['phase'] == 'brake' for row in rows), 100)
                self.assertTrue((folder / 'SHA256SUMS').exists())

    def test_a_controller_that_dies_between_trials_and_run(self):
        # The trial before a run in real time finds what crashes in it, before anything moves.
        self.refused(self.broken('DIES_IN_STEP'), 'in a trial', 'crashed', code_ran=True,
                     options=('--no-lcm', '--no-out', '--rt', 'off'))

    def test_a_board_needs_the_key(self):
        arguments = ['--backend', 'rig', '--no-lcm', '--controller', self.broken('SOUND')]
        result = self.run_program(*arguments)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('unsafe.foreign_controller=true', result.stderr)
        result = self.run_program(*arguments, '--set', 'unsafe.foreign_controller=true')
        self.assertEqual(result.returncode, 3, result.stderr)  # no board here

    def test_compare_takes_files(self):
        library = self.example()
        result = self.run_program('compare', '--controllers', f'pi,c={library}', '--repeat', 2)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('difference from pi', result.stdout)


if __name__ == '__main__':
    unittest.main()
