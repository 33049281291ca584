"""Slow readings, coarse encoders and little grip: the checks judge the wheels, or say that they cannot."""
import unittest

from program import ProgramTest

SLOW = 'any@read:slow={}ms'
STUCK, BACKWARDS, SWAPPED = 'brake@encoder_lower:stuck+0.2s', 'brake@encoder_lower:wrong=-1', 'any@encoders:wrong'


class SlowReads(ProgramTest):
    def end_of(self, *args):
        """Exit status and summary of a braking from 170 rad/s in virtual time."""
        summary = self.folder / 'summary.json'
        result = self.run_program('--backend', 'sim', '--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=170',
                                  '--summary', summary, *args)
        self.assertIn(result.returncode, (0, 1), result.stderr)
        return result.returncode, self.summary(summary)

    def with_faults(self, *faults, rate_Hz=1000):
        return self.end_of('--rate', rate_Hz, *(word for fault in faults for word in ('--inject', fault)))

    def test_slow_readings_hide_no_encoder_fault(self):
        for slow in ((), (SLOW.format(0.6),), (SLOW.format(0.95),)):
            for fault in (STUCK, BACKWARDS, SWAPPED):
                with self.subTest(slow=slow, fault=fault):
                    status, summary = self.with_faults(*slow, fault)
                    self.assertEqual((status, summary['result']), (1, 'fault'), summary['reason'])

    def test_slow_readings_alone_are_no_fault(self):
        for rate_Hz in (100, 1000):
            with self.subTest(rate_Hz):
                status, summary = self.with_faults(SLOW.format(0.6), rate_Hz=rate_Hz)
                self.assertEqual((status, summary['result']), (0, 'completed'), summary['reason'])

    def test_share_of_time_without_judgement_is_told(self):
        self.assertEqual(self.with_faults()[1]['checks_unjudged'], 0)
        self.assertAlmostEqual(self.with_faults(SLOW.format(0.6))[1]['checks_unjudged'], 0.6, delta=0.05)

    def test_no_rate_leaves_slow_readings_unchecked(self):
        """Either the encoder's fault is found, or the run ends because it cannot be judged or is late."""
        for rate_Hz in (100, 1000, 10_000):
            for share in (0.4, 0.7, 0.95):
                slow = SLOW.format(1000 * share / rate_Hz)
                with self.subTest(rate_Hz=rate_Hz, share=share):
                    status, summary = self.with_faults(slow, rate_Hz=rate_Hz)
                    if status:
                        self.assertRegex(summary['reason'], 'could not judge|overruns')
                    status, summary = self.with_faults(slow, STUCK, rate_Hz=rate_Hz)
                    self.assertEqual((status, summary['result']), (1, 'fault'), summary['reason'])

    def test_readings_too_slow_to_judge_are_a_fault(self):
        status, summary = self.end_of('--rate', 100, '--inject', SLOW.format(9.5), '--set', 'gate.judge_within_s=0.05')
        self.assertEqual(status, 1)
        self.assertIn('could not judge the wheels', summary['reason'])

    def test_few_counts_are_no_jump(self):
        _, summary = self.end_of('--set', 'plant.encoder_counts_per_rev=4')
        self.assertNotIn('cannot reach', summary['reason'])
        self.assertGreater(summary['cycles'], 100)

    def test_little_grip_is_named(self):
        status, summary = self.end_of('--set', 'plant.friction_profile=time: 0.1', '--set',
                                      'experiment.start_speed_rad_s=0')
        self.assertEqual(status, 1)
        self.assertIn('little grip', summary['reason'])


if __name__ == '__main__':
    unittest.main()
