"""--backend rig against the emulated card in another process, in real time: the outcome is asserted, never timing."""
import unittest

from rig_emulator import RigTest, skip_unless_possible


class RigRealTime(RigTest):
    def test_paper_experiment(self):
        emulator = self.emulator()
        summary = self.folder / 'summary.json'
        # 1 kHz leaves the emulator's file system no spare time if another program runs at the same time.
        program = self.real_time(emulator, '--summary', summary, '--rate', '500')
        _, errors = program.communicate(timeout=40)
        self.assertEqual(program.returncode, 0, errors)
        s = self.summary(summary)
        self.assertEqual((s['result'], s['telemetry_drops'], s['backend']), ('completed', 0, 'rig'))
        self.assertIn('not verified on hardware', errors)
        self.assertEqual(emulator.wire(), (0.0, 0.0))


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
