"""A board that is unplugged while it drives and comes back after 30 s, in real seconds: both PWMs are zero before
anything else talks to it. With a guardian of the run's own, and with the resident service."""
import time
import unittest

from resident_guardian import SAFE, ResidentTest, settings, wait_until
from rig_emulator import skip_unless_possible

AWAY_S = 30.0
WIDTH = '6C'  # of the PWM that register 60 names


class BackAfter30s(ResidentTest):
    def board_goes_and_comes_back(self, emulator, program):
        self.wait_until_driven(emulator, program)
        emulator.command('unplug')
        _, words = program.communicate(timeout=20) if self.services else (None, '')
        self.assertEqual(program.wait(timeout=20), 1, words)
        self.assertNotEqual(emulator.wire(), SAFE, 'the card holds its duties')
        gone_s = time.monotonic()
        # Somebody else who wants the card all the while.
        while time.monotonic() < gone_s + AWAY_S:
            self.assertEqual(self.run_program('--backend', 'rig', '--no-lcm', '--no-out', *settings(
                f'driver.pci.root={emulator.root}', 'driver.emulated=true')).returncode, 3)
            time.sleep(1.0)
        self.assertNotEqual(emulator.wire(), SAFE)
        traffic = emulator.root.parent / 'traffic.txt'
        emulator.command(f'record {traffic}')
        emulator.command('plug')
        plugged_ns = time.monotonic_ns()
        other = self.start(emulator, '--set', 'driver.emulated=true', resident='require' if self.services else 'off')
        wait_until(lambda: emulator.widths().zero_since_ns is not None or emulator.widths().last_written_ns > plugged_ns,
                   'nobody writes')
        _, words = other.communicate(timeout=60)
        self.assertIn(other.returncode, (0, 1, 3), words)  # the wheel may still be too fast
        emulator.command('record off')
        accesses = [tuple(line.split()) for line in traffic.read_text().splitlines()]
        widths = [int(value, 16) for way, offset, value in accesses if (way, offset) == ('W', WIDTH)]
        self.assertEqual(widths[:2], [0, 0], 'the first words to the board are zero, for both PWMs')
        driven = next((n for n, (way, offset, value) in enumerate(accesses)
                       if (way, offset) == ('W', WIDTH) and int(value, 16)), len(accesses))
        self.assertGreaterEqual(accesses[:driven].count(('R', WIDTH, '00000000')), 2, 'read back before anybody drives')

    def test_a_guardian_of_its_own(self):
        emulator = self.emulator()
        self.board_goes_and_comes_back(emulator, self.start(emulator, *settings('guardian.insist_s=90'), resident='off'))

    def test_the_resident_service(self):
        emulator = self.emulator()
        service = self.service(emulator)
        self.board_goes_and_comes_back(emulator, self.start(emulator))
        self.assertIn('NOT SAFE', service.said())


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
