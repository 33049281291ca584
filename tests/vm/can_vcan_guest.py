"""Within the virtual machine: driver.kind=can on vcan. Arguments: ABS_HIL, then Paper or Faults."""
import pathlib
import random
import socket
import struct
import subprocess
import threading
import time
import unittest

from can_rig import PROGRAM, CanRigTest, shell
from dbc import Dbc, frames_of

DBC = pathlib.Path(__file__).parents[2] / 'config' / 'can' / 'abs_rig.dbc'


class Babbler:
    """A third node that sends 10,000 frames a second of the identifiers given, with any content."""

    def __init__(self, interface, identifiers):
        self.socket = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b'')
        self.socket.bind((interface,))
        self.frames = [struct.pack('=IB3x8s', identifier, 8, random.randbytes(8)) for identifier in identifiers]
        self.stop, self.sent, self.seconds = False, 0, 0.0
        self.thread = threading.Thread(target=self.babble)
        self.thread.start()

    def babble(self):
        start = time.monotonic()
        while not self.stop:
            due = int((time.monotonic() - start) * 10_000)
            while self.sent < due:
                try:
                    self.socket.send(self.frames[self.sent % len(self.frames)])
                except OSError:  # its queue is full: it goes on
                    pass
                self.sent += 1
            time.sleep(0.0005)
        self.seconds = time.monotonic() - start

    def end(self):
        self.stop = True
        self.thread.join()
        self.socket.close()


class Vcan(CanRigTest):
    def setUp(self):
        super().setUp()
        shell('ip link set vcan0 up')


class Paper(Vcan):
    def test_classic_frames(self):
        self.node()
        log = self.folder / 'candump.log'
        with open(log, 'w') as file:
            dump = subprocess.Popen(['candump', '-L', 'vcan0'], stdout=file)
        time.sleep(0.2)
        self.check_paper_run(self.start('--set', 'driver.can.fd=off'))
        dump.terminate()
        dump.wait()
        self.check_recording(log, self.summary()['cycles'])
        subprocess.run([PROGRAM, 'doctor', '--only', 'can'], check=True)

    def check_recording(self, log, cycles):
        dbc, counts, brake, last = Dbc(DBC), {}, 0.0, {}
        frames = [dbc.decode(identifier, data) for _, identifier, data in frames_of(log)]
        # The guardian believes the run's end when it has read the node back: the last command is its own.
        end = max(n for n, (name, _) in enumerate(frames) if name == 'ABS_COMMAND')
        self.assertEqual((frames[end][1]['Sequence'], frames[end][1]['BrakeDuty']), (0, 0))
        for name, values in frames[:end]:
            counts[name] = counts.get(name, 0) + 1
            brake = max(brake, values.get('BrakeDuty', 0.0))
            if name in ('ABS_SYNC', 'ABS_COMMAND', 'ABS_ENCODERS', 'ABS_LATCH'):
                if name in last:
                    self.assertEqual(int(values['Sequence']), (last[name] + 1) % 256, name)
                last[name] = int(values['Sequence'])
        print(f'  candump decoded with the DBC: {counts}')
        # One SYNC more than cycles: that of the activation. The last command is the safe state's.
        self.assertEqual(counts['ABS_SYNC'], cycles + 1)
        self.assertEqual(counts['ABS_ENCODERS'], cycles + 1)
        self.assertEqual(counts['ABS_LATCH'], cycles + 1)
        self.assertEqual(counts['ABS_COMMAND'], cycles + 1)
        self.assertGreaterEqual(counts['ABS_STATUS'], cycles // 10)
        self.assertNotIn('ABS_TIME', counts)
        self.assertTrue(0.3 < brake < 0.70005, brake)  # the cap, in steps of 0.0001
        self.check_with_cantools(log)

    def check_with_cantools(self, log):
        try:
            import cantools
        except ImportError:
            print('  cantools is not installed: decoded with our own reader alone')
            return
        database = cantools.database.load_file(DBC)
        for _, identifier, data in list(frames_of(log))[:1000]:
            database.decode_message(identifier, data)

    def test_can_fd(self):
        shell('ip link set vcan0 down && ip link set vcan0 mtu 72 && ip link set vcan0 up')
        try:
            self.node()
            self.check_paper_run(self.start('--set', 'driver.can.fd=on'))
        finally:
            shell('ip link set vcan0 down && ip link set vcan0 mtu 16 && ip link set vcan0 up')


class Faults(Vcan):
    def babbler(self, identifiers):
        babbler = Babbler('vcan0', identifiers)
        self.ends.append(babbler.end)
        return babbler

    def test_interface_down_in_acceleration(self):
        node = self.node()
        program = self.accelerating(node)
        shell('ip link set vcan0 down')
        self.check_ended(program, 'CAN interface is down or gone')
        self.assertEqual(self.check_zero_in_time(node), 'watchdog')

    def test_safe_ends_a_run(self):
        """It makes the node inactive. The run hears that somebody else commands the node."""
        node = self.node()
        program = self.accelerating(node)
        result = subprocess.run([PROGRAM, 'safe', '--set', 'driver.kind=can', '--set', 'driver.can.interface=vcan0'],
                                capture_output=True, text=True, timeout=20)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertIn('board of driver.kind=can: drive 0 and brake 0, verified', result.stdout)
        self.check_ended(program, 'something else writes to the board')
        self.assertEqual(node.wire(), (0.0, 0.0))

    def test_node_killed_in_braking(self):
        node = self.node()
        program = self.braking(node)
        node.process.kill()
        errors = self.check_ended(program, 'CAN node missed too many answers')
        self.assertIn('watchdog should have zeroed them', errors)

    def test_node_replaced_by_one_with_stale_sequences(self):
        first, second = self.node(), self.node('--command', 'fault silent')
        program = self.braking(first)
        second.command('fault stale=20')
        first.process.kill()
        self.check_ended(program, 'CAN node answers with old sequence numbers')
        self.assertEqual(second.wire(), (0.0, 0.0))

    def test_client_killed_in_braking(self):
        node = self.node()
        program = self.braking(node)
        program.kill()
        program.communicate()
        time.sleep(0.05)
        self.assertEqual(self.check_zero_in_time(node), 'watchdog')

    def test_wrong_length(self):
        node = self.node()
        program = self.braking(node)
        node.command('fault wrong-size=6')
        self.check_ended(program, 'CAN frames have the wrong length')
        node.command('fault ok')
        self.check_zero_in_time(node)

    def test_third_node_babbles_other_identifiers(self):
        node = self.node()
        babbler = self.babbler(range(0x100, 0x700))
        program = self.start('--set', 'experiment.cut_speed_rad_s=60')
        errors = self.finish(program, 0)
        babbler.end()
        self.assertGreater(babbler.sent, 9_000 * babbler.seconds)
        self.assertIn('cycles, 0 without an answer in time', errors)
        self.assertEqual(node.wire(), (0.0, 0.0))

    def test_third_node_forges_the_nodes_identifiers(self):
        node = self.node()
        program = self.braking(node)
        self.babbler([0x90, 0x91, 0x92, 0x93])
        self.check_ended(program, "CAN frames with the node's identifiers have a wrong check value")
        self.check_zero_in_time(node)

    def test_third_node_forges_commands(self):
        node = self.node()
        program = self.braking(node)
        self.babbler([0x81])
        self.check_ended(program, 'something else writes to the board')
        self.check_zero_in_time(node)

    def test_interface_down_and_unknown_at_start(self):
        self.node()
        shell('ip link set vcan0 down')
        self.assertIn('sudo ip link set vcan0 up', self.finish(self.start(), 3))
        self.host = 'can7'
        self.assertIn('no CAN interface can7 (driver.can.interface); there are vcan0', self.finish(self.start(), 3))


if __name__ == '__main__':
    shell('modprobe -a can_raw vcan && ip link add vcan0 type vcan')
    unittest.main(verbosity=2)
