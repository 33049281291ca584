"""doctor and runs on trees of plain files that look like the kernel's: each card that must not be driven is refused with
its own sentence, and not one register of it is written."""
import os
import pathlib
import shutil
import struct
import subprocess
import tempfile
import unittest

from program import PROGRAM, ProgramTest

ADDRESS = '0000:03:00.0'
GOOD_BAR = '0x000000000000e000 0x000000000000e0ff 0x0000000000040101'
REGISTERS = {0x00: 2741, 0x04: 0x3200, 0x38: 3833}  # version, 3 counters, 24 V


class Tree:
    """A card below ROOT/sys/bus/pci/devices that nothing is wrong with."""

    def __init__(self, root, bar=GOOD_BAR, enable='1', registers=()):
        self.devices = root / 'sys/bus/pci/devices'
        self.card = self.devices / ADDRESS
        self.card.mkdir(parents=True)
        for name, text in (('vendor', '0x10b5'), ('device', '0x2497'), ('enable', enable),
                           ('resource', '0x0 0x0 0x0\n0x0 0x0 0x0\n' + bar)):
            (self.card / name).write_text(text + '\n')
        content = bytearray(256)
        for offset, value in {**REGISTERS, **dict(registers)}.items():
            struct.pack_into('<I', content, offset, value)
        self.ports = self.card / 'resource2'
        self.ports.write_bytes(content)
        self.content = bytes(content)


def locked_down(tree):
    folder = tree.devices.parents[2] / 'kernel/security'
    folder.mkdir(parents=True)
    (folder / 'lockdown').write_text('none [integrity] confidentiality\n')


def bound(tree):
    (tree.card / 'driver').symlink_to('../../../../bus/pci/drivers/uio_pci_generic')


# name, the tree's arguments, what else to do to it, settings, words
REFUSED = [
    ('BAR without an address', {'bar': '0x0 0xff 0x20040101'}, None, [], 'its I/O ports (BAR 2) are not assigned'),
    ('BAR switched off', {'bar': '0xe000 0xe0ff 0x10040101'}, None, [], 'its I/O ports (BAR 2) are disabled'),
    ('disabled device', {'enable': '0'}, None, [], 'not enabled'),
    ('bound driver', {}, bound, [], 'owned by the kernel driver uio_pci_generic'),
    ('lockdown', {}, locked_down, [], 'the kernel is locked down (Secure Boot)'),
    ('wrong bitstream', {}, None, ['driver.pci.bitstream=2742'], 'bitstream version 2741 is not the configured 2742'),
    ('another logic', {'registers': {0x04: 0x1200}.items()}, None, [], 'register 04 gives it 1 encoder counters'),
    ('no supply', {'registers': {0x38: 0}.items()}, None, [], 'supply 0 V: the rig is switched off'),
]


# Each switched a protection off without a word.
WEAK = [('guardian.insist_s', 0.001), ('gate.overspeed_rad_s', 2000), ('experiment.cut_speed_rad_s', 1000),
        ('realtime.cycle_gap_max_s', 1), ('realtime.late_max_s', 10), ('gate.judge_within_s', 1),
        ('gate.temperature_max_C', 200), ('gate.free_slip_max', 0.5)]


class FailClosed(ProgramTest):
    def programs(self, tree, settings):
        chosen = [word for s in (f'driver.pci.root={tree.devices}', *settings) for word in ('--set', s)]
        return (('doctor', '--backend', 'rig', '--only', 'backend', *chosen),
                ('--backend', 'rig', '--no-lcm', '--rt', 'off', *chosen))

    def test_each_is_refused_by_name_and_not_written_to(self):
        for number, (name, arguments, change, settings, words) in enumerate(REFUSED):
            tree = Tree(self.folder / str(number), **arguments)
            if change:
                change(tree)
            for command in self.programs(tree, settings):
                with self.subTest(name, command=command[0]):
                    result = self.run_program(*command)
                    self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
                    self.assertIn(words, result.stdout + result.stderr)
                    self.assertIn('nothing was written', result.stdout + result.stderr)
                    self.assertEqual(tree.ports.read_bytes(), tree.content)

    def test_registers_that_may_not_be_written(self):
        # Root may write to any file, so this is tried as somebody else.
        with tempfile.TemporaryDirectory() as folder:
            os.chmod(folder, 0o755)
            tree = Tree(pathlib.Path(folder) / 'tree')
            tree.ports.chmod(0o444)
            user = {'user': 65534, 'group': 65534, 'extra_groups': []} if os.getuid() == 0 else {}
            if shutil.which(PROGRAM) is None:
                self.skipTest('another user cannot run the program')
            for command in self.programs(tree, []):
                result = subprocess.run([PROGRAM, *command, *([] if command[0] == 'doctor' else ['--no-out'])], cwd=folder,
                                        capture_output=True, text=True, timeout=20, **user)
                self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
                self.assertIn('permission denied', result.stdout + result.stderr)
                self.assertEqual(tree.ports.read_bytes(), tree.content)

    def test_weak_values_need_a_consent_on_a_board(self):
        # Below the kernel's own folder every card is real; here there is none, so an accepted run ends with 3.
        for key, value in WEAK:
            with self.subTest(key):
                command = ('--backend', 'rig', '--no-lcm', '--rt', 'off', '--set', f'{key}={value}')
                refused = self.run_program(*command)
                self.assertEqual(refused.returncode, 2, refused.stderr)
                self.assertIn(f'{key} = ', refused.stderr)
                self.assertIn(f'--set unsafe.keys={key}', refused.stderr)
                accepted = self.run_program(*command, '--set', f'unsafe.keys=gate.free_slip_max,{key}')
                self.assertEqual(accepted.returncode, 3, accepted.stderr)
                self.assertIn('weakens the protection of this board', accepted.stderr)

    def test_consents_are_spelled_right_and_come_from_a_person(self):
        result = self.run_program('--backend', 'rig', '--no-lcm', '--set', 'unsafe.keys=gate.free_slipmax')
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('nearest known key is gate.free_slip_max', result.stderr)
        script = self.folder / 'own.toml'
        script.write_text('[settings]\nunsafe.keys = "gate.free_slip_max"\n[[phase]]\nname = "wait"\nuntil = { lasts_s = 1 }\nat_most_s = 2\n')
        result = self.run_program('validate', script)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('a script must not set unsafe.keys', result.stderr)

    def test_the_encoders_scale_is_the_identity_s(self):
        result = self.run_program('--backend', 'rig', '--no-lcm', '--set', 'model.encoder_counts_per_rev=2048')
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('rig.encoder_counts_per_rev', result.stderr)

    def test_doctor_says_that_a_good_tree_can_run(self):
        tree = Tree(self.folder / 'good')
        result = self.run_program(*self.programs(tree, [])[0])
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertIn('can run', result.stdout)
        self.assertEqual(tree.ports.read_bytes(), tree.content, 'the write that doctor tries changes nothing')


if __name__ == '__main__':
    unittest.main(verbosity=2)
