"""Controllers from files on the emulated card, in real time: in the program's own process, tried out before the motor
starts. usage: see foreign.py"""
import unittest

from foreign import broken, example  # first: it reads the arguments
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
