"""abs_hil safe on the emulated card sets both outputs to 0 and verifies them, even while another process drives it."""
import os
import signal
import time
import unittest

from rig_emulator import RigTest, skip_unless_possible

SAFE = (0.0, 0.0)


def guardian_of(pid):
    with open(f'/proc/{pid}/task/{pid}/children') as children:
        return int(children.read().split()[0])


class Safe(RigTest):
    def safe(self, emulator, *args):
        return self.run_program('safe', '--set', f'driver.pci.root={emulator.root}', *args)

    def driving(self, *settings):
        emulator = self.emulator()
        program = self.real_time(emulator, *settings)
        self.wait_until_driving(emulator)
        return emulator, program

    def assert_made_safe(self, emulator, result):
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('RT-DAC4/PCI at 0000:03:00.0: drive 0 and brake 0, verified', result.stdout)
        self.assertEqual(emulator.wire(), SAFE)

    def test_idle_card(self):
        emulator = self.emulator()
        self.assert_made_safe(emulator, self.safe(emulator))

    def test_a_run_in_order_is_ended(self):
        emulator, program = self.driving()
        result = self.safe(emulator)
        self.assert_made_safe(emulator, result)
        self.assertIn(f'ended process {program.pid} (abs_hil)', result.stdout)
        program.communicate(timeout=20)
        self.assertEqual(program.returncode, 143)

    def test_a_run_that_would_brake_first_is_ended_at_once(self):
        emulator, program = self.driving('--set', 'experiment.stop_brake_duty=0.6')
        self.assert_made_safe(emulator, self.safe(emulator))
        program.communicate(timeout=20)

    def test_a_stopped_run_is_ended(self):
        emulator, program = self.driving()
        program.send_signal(signal.SIGSTOP)
        self.assert_made_safe(emulator, self.safe(emulator))
        program.communicate(timeout=20)
        self.assertEqual(program.returncode, -signal.SIGKILL)

    def test_outputs_that_nobody_watches(self):
        emulator, program = self.driving()
        os.kill(guardian_of(program.pid), signal.SIGKILL)
        program.kill()
        program.communicate(timeout=20)
        self.assertGreater(emulator.wire()[0], 0.0, 'the card holds')
        self.assert_made_safe(emulator, self.safe(emulator))

    def test_what_cannot_be_verified_says_what_to_pull(self):
        emulator = self.emulator()
        emulator.command('fault 6c:wrong=1')
        result = self.safe(emulator, '--insist', '0.2')
        self.assertEqual(result.returncode, 1)
        self.assertIn('SAFE STATE NOT VERIFIED: register does not read back', result.stderr)
        self.assertIn("pull the rig's power plug", result.stderr)
        emulator.command('fault 6c:ok')
        emulator.command('unplug')
        gone = self.safe(emulator)
        self.assertEqual(gone.returncode, 3)
        self.assertIn('no board found', gone.stderr)
        self.assertIn('A CAN node cannot be found', gone.stderr)
        self.assertIn('driver.kind=can', gone.stderr)
        self.assertIn("pull the rig's power plug", gone.stderr)

    def test_a_wrong_configuration_elsewhere_does_not_matter(self):
        emulator = self.emulator()
        config = self.folder / 'broken.toml'
        config.write_text(f'[driver.pci]\nroot = "{emulator.root}"\n[gate]\nbrake_duty_max = 1.0\n')
        result = self.run_program('safe', '--config', config)
        self.assert_made_safe(emulator, result)

    def test_an_unplugged_board_that_comes_back_is_zero_first(self):
        emulator = self.emulator()
        program = self.real_time(emulator, '--set', 'guardian.insist_s=60')
        self.wait_until_driving(emulator)
        guardian = guardian_of(program.pid)
        emulator.command('unplug')
        self.assertEqual(program.wait(timeout=20), 1)
        time.sleep(12)  # longer than a guardian tries on an emulator by default
        self.assertTrue(os.path.exists(f'/proc/{guardian}'), 'the guardian still tries')
        emulator.command('plug')
        end = time.monotonic() + 20
        while os.path.exists(f'/proc/{guardian}') and time.monotonic() < end:
            time.sleep(0.01)
        self.assertEqual(emulator.wire(), SAFE)
        self.assertIn('written and read back', program.communicate(timeout=20)[1])

    def test_a_person_releases_the_guardian(self):
        emulator = self.emulator()
        program = self.real_time(emulator, '--set', 'guardian.insist_s=60')
        self.wait_until_driving(emulator)
        guardian = guardian_of(program.pid)
        os.kill(guardian, signal.SIGUSR1)  # before there is anything to release it from
        emulator.command('unplug')
        program.wait(timeout=20)
        self.assertTrue(os.path.exists(f'/proc/{guardian}'))
        os.kill(guardian, signal.SIGUSR1)
        _, errors = program.communicate(timeout=20)
        self.assertIn(f'kill -USR1 {guardian}', errors)
        self.assertIn('then released by a person', errors)


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
