"""Controllers from files on the emulated card, in real time: in the program's own process, tried out before the motor
starts. usage: see foreign.py"""
import unittest

from foreign import broken, example, hostile  # first: it reads the arguments
from rig_emulator import RigTest, skip_unless_possible


class EmulatedCard(RigTest):
    def run_it(self, library, *args):
        emulator = self.emulator()
        summary = self.folder / 'summary.json'
        program = self.real_time(emulator, '--controller', library, '--rt', 'prefer', '--rate', '500', '--summary', summary,
                                 '--recorder', self.folder, *args)
        _, errors = program.communicate(timeout=60)
        self.wait_for(emulator)
        return program.returncode, errors, self.summary(summary) if summary.stat().st_size else {}

    def wait_for(self, emulator):
        while emulator.wire() != (0.0, 0.0):
            pass

    def test_the_example_in_c(self):
        status, errors, summary = self.run_it(example(self.folder))
        self.assertEqual(status, 0, errors)
        self.assertEqual(summary['result'], 'completed')
        foreign = summary['foreign_controller']
        self.assertFalse(foreign['own_process'])
        self.assertEqual(foreign['trial']['steps'], 2000)
        self.assertGreater(foreign['trial']['step_us']['max'], 0.0)
        self.assertEqual((foreign['trial']['allocations'], foreign['trial']['system_calls']), (0, 0))
        self.assertGreater(foreign['steps'], 100)
        self.assertGreater(foreign['step_us']['max'], 0.0)
        self.assertIn('steps took', errors)

    def test_what_real_time_code_must_not_do_is_reported(self):
        for kind, key, word in (('ALLOCATES', 'allocations', 'allocations in'),
                                ('CALLS_SYSTEM', 'system_calls', 'system calls in')):
            with self.subTest(kind):
                status, errors, summary = self.run_it(broken(self.folder, kind))
                self.assertEqual(status, 0, errors)
                self.assertEqual(summary['foreign_controller']['trial'][key], 2000)
                self.assertIn(word, errors)

    def test_what_ends_the_program_does_not_choose_how(self):
        """Outputs are zero, the status is not 0, and somebody says why."""
        # deed: status, words of the program (the guardian's where the program has none any more)
        for deed, (status, words) in {'EXITS': (1, 'called exit() or quick_exit()'),
                                      'EXITS_QUICKLY': (1, 'called exit() or quick_exit()'),
                                      'EXITS_AT_ONCE': (1, 'called _exit()'),
                                      'EXITS_IN_THREAD': (1, 'called exit() or quick_exit()'),
                                      'ENDS_THREAD': (-6, 'drive 0 and brake 0 written and read back'),
                                      'ABORTS': (-6, 'drive 0 and brake 0 written and read back')}.items():
            with self.subTest(deed):
                emulator = self.emulator()
                program = self.real_time(emulator, '--controller', hostile(self.folder, deed, 'AT_STEP=2500'), '--rt', 'prefer',
                                         '--rate', '500', '--recorder', self.folder / deed)
                _, errors = program.communicate(timeout=60)
                self.assertEqual(program.returncode, status, errors)
                self.assertIn(words, errors)
                if status == 1:
                    self.assertIn('The outputs are safe', errors)
                self.wait_for(emulator)
                if deed != 'EXITS_IN_THREAD':  # the cycle could end in order
                    self.assertEqual(len(list((self.folder / deed).glob('recorder-*.txt'))), 1, errors)

    def test_what_ends_while_it_is_made_is_refused(self):
        for deed in ('EXITS', 'EXITS_AT_ONCE', 'FORK_BOMB'):
            for place in ('IN_CONSTRUCTOR', 'IN_CREATE'):
                with self.subTest(deed, place=place):
                    program = self.real_time(self.emulator(), '--controller', hostile(self.folder, deed, place), '--rt', 'prefer')
                    _, errors = program.communicate(timeout=60)
                    self.assertEqual(program.returncode, 2, errors)

    def test_the_guardian_makes_a_crash_safe(self):
        emulator = self.emulator()
        program = self.real_time(emulator, '--controller', broken(self.folder, 'DIES_LATE'), '--rt', 'prefer', '--rate', '500',
                                 '--recorder', self.folder)
        _, errors = program.communicate(timeout=60)
        self.assertEqual(program.returncode, -11, errors)
        self.wait_for(emulator)  # nobody but the guardian is there to write the zeros


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
