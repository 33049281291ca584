"""Programs that are not ours talk to the emulated 7I92: Debian's mesaflash reads what it is, LinuxCNC's hm2_eth drives it.

usage: hm2_partners_test.py ABS_HIL Mesaflash|LinuxCnc. Enters namespaces of its own. Status 77 where the packages
(scripts/packages-mesa.txt, packages-linuxcnc.txt), root or namespaces cannot be had.
"""
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

from emulator_process import EMULATOR, EmulatorProcess, EmulatorTest

INSIDE = 'ABS_HIL_HM2_PARTNERS_INSIDE'
BOARD, HOST = '10.10.10.10', '10.10.10.1'
#: hm2_eth pins the ARP entry to the address in the EEPROM, so the interface must have it.
MAC = '00:60:1b:16:ab:50'
NEEDS = {'Mesaflash': (['mesaflash', 'ip'], 'packages-mesa.txt'),
         'LinuxCnc': (['halrun', 'ip', 'iptables'], 'packages-linuxcnc.txt')}


def enter(arguments, what):
    """Runs this file inside namespaces of its own."""
    programs, packages = NEEDS[what]
    missing = [p for p in programs if shutil.which(p) is None] + [str(p) for p in [EMULATOR] if not p.exists()]
    words = ['unshare', '--net', '--mount', '--ipc', '--pid', '--fork', '--mount-proc', '--kill-child']
    if missing:
        print(f'SKIPPED: no {", ".join(missing)} (scripts/setup.sh {packages})')
        return 77
    probe = subprocess.run([*words, 'true'], capture_output=True, text=True)
    if probe.returncode != 0:
        print(f'SKIPPED: no namespaces of our own here (they need root): {probe.stderr.strip()}')
        return 77
    return subprocess.run([*words, sys.executable, *arguments], env=dict(os.environ, **{INSIDE: '1'})).returncode


def ip(*words):
    subprocess.run(['ip', *words], check=True)


class Mesaflash(EmulatorTest):
    def setUp(self):
        super().setUp()
        ip('link', 'set', 'lo', 'up')
        ip('addr', 'add', f'{BOARD}/32', 'dev', 'lo')

    def tearDown(self):
        super().tearDown()
        ip('addr', 'del', f'{BOARD}/32', 'dev', 'lo')

    def read_out(self):
        result = subprocess.run(['mesaflash', '--device', '7I92', '--addr', BOARD, '--readhmid', '--dbname1', 'G540',
                                 '--dbname2', 'G540'], capture_output=True, text=True, timeout=20)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return result.stdout

    def check_read_out(self, text):
        for fact in ('BoardName : MESA7I92', 'Number of IO Ports: 2', 'Width of one I/O port: 17',
                     'Clock Low frequency: 100.0000 MHz', 'Clock High frequency: 200.0000 MHz',
                     'There are 1 of WatchDog', 'There are 2 of QCount', 'There are 2 of PWM'):
            self.assertIn(fact, text)
        pins = dict(re.findall(r'^\S+\s+(\d+)\s+IOPort\s+(\S+\s+\d\s+\S+)', text, re.M))
        functions = {int(pin): function.split() for pin, function in pins.items() if 'None' not in function}
        expected = {1: ['PWM', '0', 'PWM'], 18: ['PWM', '1', 'PWM']}
        for first, unit in ((13, '0'), (30, '1')):
            expected |= {first + i: ['QCount', unit, line] for i, line in enumerate(('Quad-A', 'Quad-B', 'Quad-IDX'))}
        self.assertEqual(functions, expected)

    def test_mesaflash_reads_modules_and_pins(self):
        self.start_emulator(EmulatorProcess, '--hm2', BOARD, '--board-name', '7I92', '--priority', 0)
        self.check_read_out(self.read_out())

    def test_mesaflash_reads_the_node_that_presents_itself_as_a_7i92(self):
        self.start_emulator(EmulatorProcess, '--node', BOARD, '--board-name', '7I92', '--priority', 0)
        self.check_read_out(self.read_out())

    def test_mesaflash_refuses_the_nodes_own_name_with_it(self):
        self.start_emulator(EmulatorProcess, '--node', BOARD, '--priority', 0)
        result = subprocess.run(['mesaflash', '--device', '7I92', '--addr', BOARD, '--readhmid'], capture_output=True,
                                text=True, timeout=20)
        self.assertIn(f'Unsupported ethernet device abs-node at {BOARD}', result.stdout + result.stderr)

    def test_mesaflash_sees_the_lie(self):
        self.start_emulator(EmulatorProcess, '--hm2', BOARD, '--board-name', '7I92', '--priority', 0, '--wrong-board',
                            '0x458=0x01010204')
        self.assertIn('There are 1 of QCount', self.read_out())


class OtherNamespace(EmulatorProcess):
    """The emulator in the network namespace of the board."""

    def __init__(self, folder, *args):
        wrapper = folder / 'emulator'
        wrapper.write_text(f'#!/bin/sh\nexec ip netns exec board {EMULATOR} "$@"\n')
        wrapper.chmod(0o755)
        super().__init__(folder, *args, program=wrapper)


#: The configuration of the recording in tests/emulator/hm2_frames.txt, but for two values, because this is no real-time
#: computer: a watchdog of 0.5 s, and late answers, which LinuxCNC counts but does not make an error of. The pins of the PWM are inverted, as the rig's wiring needs it.
HAL = f'''
loadrt hostmot2
loadrt hm2_eth board_ip="{BOARD}" config="num_encoders=2 num_pwmgens=2 num_stepgens=0"
loadrt threads name1=servo period1=1000000
addf hm2_7i92.0.read servo
addf hm2_7i92.0.write servo
setp hm2_7i92.0.watchdog.timeout_ns 500000000
setp hm2_7i92.0.packet-error-limit 1000000
setp hm2_7i92.0.pwmgen.pwm_frequency 160
setp hm2_7i92.0.gpio.001.invert_output 1
setp hm2_7i92.0.gpio.018.invert_output 1
setp hm2_7i92.0.pwmgen.00.value 0.7
setp hm2_7i92.0.pwmgen.01.value 0.25
setp hm2_7i92.0.pwmgen.00.enable 1
setp hm2_7i92.0.pwmgen.01.enable 1
start
loadusr -w sleep 1
'''


class LinuxCnc(EmulatorTest):
    @classmethod
    def setUpClass(cls):
        # `ip netns` keeps its names below /run, which this test has for itself. LinuxCNC's process is another user there.
        subprocess.run(['mount', '-t', 'tmpfs', '-o', 'mode=1777', 'none', '/run'], check=True)

    def setUp(self):
        super().setUp()
        ip('link', 'set', 'lo', 'up')
        ip('netns', 'add', 'board')
        ip('link', 'add', 'to-board', 'type', 'veth', 'peer', 'name', 'to-host', 'address', MAC, 'netns', 'board')
        ip('addr', 'add', f'{HOST}/24', 'dev', 'to-board')
        ip('link', 'set', 'to-board', 'up')
        ip('-n', 'board', 'addr', 'add', f'{BOARD}/24', 'dev', 'to-host')
        ip('-n', 'board', 'link', 'set', 'to-host', 'up')

    def tearDown(self):
        super().tearDown()
        ip('link', 'del', 'to-board')
        ip('netns', 'del', 'board')

    def drive(self, board):
        """LinuxCNC drives the board for 1 s. Its output, and the board's registers and speeds meanwhile."""
        meanwhile = self.folder / 'meanwhile'
        script = self.folder / 'rig.hal'
        script.write_text(HAL + f'show pin hm2_7i92.0.encoder\nshow pin hm2_7i92.0.packet\nloadusr -w touch {meanwhile}\n'
                          'loadusr -w sleep 1\n')
        environment = dict(os.environ, RTAPI_UID='1000', RTAPI_FIFO_PATH='/run/rtapi_fifo')
        with open(self.folder / 'output', 'w+') as output:
            # Before the other programs of a busy computer, so that LinuxCNC does not lose answers while it looks for the board.
            running = subprocess.Popen(['chrt', '-f', '40', 'halrun', '-f', script], env=environment, stdout=output, stderr=output,
                                       stdin=subprocess.DEVNULL)
            while not meanwhile.exists() and running.poll() is None:
                os.sched_yield()
            registers, status = board.command('registers'), board.command('status')
            status_of_halrun = running.wait(timeout=60)
            output.seek(0)
            text = output.read()
            self.assertEqual(status_of_halrun, 0, text)
            return text, dict(re.findall(r'(\w{4})=(\w{8})', registers)), status

    def test_linuxcnc_finds_drives_and_leaves_the_board(self):
        board = self.start_emulator(OtherNamespace, '--hm2', BOARD, '--board-name', '7I92', '--start-speed', 40)
        output, registers, status = self.drive(board)
        self.assertIn(f'{BOARD}: INFO: Hardware address (MAC): {MAC}', output)
        self.assertIn('discovered 7I92', output)
        self.assertIn('IO Pin 018 (P1-14): PWMGen #1, pin Out0', output)
        # What it has written, register by register: the recording's values, but for watchdog and inversion.
        expected = {'0C00': '02faf07f', '0D00': '00000000', '1100': '00000002', '1104': '00000002', '1200': '0000e002',
                    '1204': '0000e002', '1300': '00000000', '1400': '00000002', '1404': '00000002', '3100': '00000800',
                    '3104': '00000800', '3200': '00000030', '3400': '00000002', '4000': '0b320000', '4004': '03ff0000',
                    '4100': '00000023', '4104': '00000023', '4200': '000000d6', '4300': '00000006', '4400': '00000003'}
        self.assertEqual({name: registers[name] for name in expected}, expected)
        drive, brake = map(float, re.search(r'drive ([\d.]+), brake ([\d.]+)', status).groups())
        self.assertAlmostEqual(drive, 2866 / 4096, delta=1e-4)
        self.assertAlmostEqual(brake, 1023 / 4096, delta=1e-4)
        # Speeds that it finds from counts and time stamps. Between its print and ours the drive goes on for some ms.
        velocities = [float(v) for v in re.findall(r'([-\d.e+]+)\s+hm2_7i92\.0\.encoder\.0[01]\.velocity$', output, re.M)]
        speeds = [float(v) for v in re.search(r'upper ([-\d.]+) rad/s, lower ([-\d.]+)', status).groups()]
        self.assertEqual(len(velocities), 2, output)
        for velocity, speed in zip(velocities, reversed(speeds)):
            self.assertAlmostEqual(velocity * 2 * math.pi / 4096 / speed, 1.0, delta=0.05)
        # It ends with a watchdog that bites; the pins are pulled high.
        end = board.command('status')
        self.assertIn('drive 0.0000, brake 0.0000', end)
        self.assertIn('pins pulled high', end)
        events = [line.split(' ', 2)[2] for line in board.lines if line.startswith('event')]
        self.assertEqual(events[-2], 'watchdog')
        self.assertIn('outputs zero: watchdog', events[-1])

    def test_linuxcnc_drives_the_node_once_and_its_soft_reset_brings_nothing_back(self):
        board = self.start_emulator(OtherNamespace, '--node', BOARD, '--board-name', '7I92', '--mac', MAC, '--start-speed', 40)
        output, registers, _ = self.drive(board)
        self.assertIn('discovered 7I92', output)
        expected = {'1200': '0000e002', '1204': '0000e002', '4100': '00000023', '4200': '000000d6', '3200': '00000030'}
        self.assertEqual({name: registers[name] for name in expected}, expected)
        end = board.command('status')
        self.assertIn('drive 0.0000, brake 0.0000', end)
        self.assertIn('watchdog has bitten', end)
        events = [line.split(' ', 2)[2] for line in board.lines if line.startswith('event')]
        # The node cuts LinuxCNC's watchdog to 20 ms, which this computer may miss: the bite then holds.
        self.assertEqual(sum('outputs on' in event for event in events), 1, events)
        self.assertIn('outputs zero', events[-1])


if __name__ == '__main__':
    if os.environ.get(INSIDE) != '1':
        program = pathlib.Path(os.path.abspath(EMULATOR)).parent / 'abs_hil'
        sys.exit(enter([os.path.abspath(__file__), str(program), *sys.argv[1:]], sys.argv[1]))
    unittest.main()
