"""Within the virtual machine: driver.kind=can on an slcan interface whose adapter this test plays, so that the kernel's
controller goes through its error states. The adapter hands frames on to the emulated node over a socket."""
import fcntl
import os
import pty
import select
import socket
import struct
import termios
import threading
import tty
import unittest

from can_rig import CanRigTest, Node, shell

N_SLCAN = 17
SIOCGIFNAME = 0x8910
FRAME = struct.Struct('=IB3x8s')


class Adapter:
    """Lawicel's protocol at the master side of a pty: "tIIILDD...\\r" is a frame, both ways."""

    def __init__(self):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.master)
        tty.setraw(self.slave)
        fcntl.ioctl(self.slave, termios.TIOCSETD, struct.pack('i', N_SLCAN))
        self.name = fcntl.ioctl(self.slave, SIOCGIFNAME, b'\0' * 16).rstrip(b'\0').decode()
        self.node = None
        self.off = False
        self.pending = b''
        threading.Thread(target=self.carry, daemon=True).start()

    def connect(self, path):
        node = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        node.connect(path)
        self.off, self.node = False, node

    def disconnect(self):
        node, self.node = self.node, None
        node.close()

    def say(self, text):
        os.write(self.master, text.encode())

    def carry(self):
        while True:
            node = self.node
            ready = select.select([self.master] + ([node] if node else []), [], [], 0.02)[0]
            if self.master in ready:
                self.from_host(os.read(self.master, 4096))
            if node in ready and node is self.node:
                self.from_node(node.recv(72))

    def from_host(self, data):
        self.pending += data
        *lines, self.pending = self.pending.split(b'\r')
        for line in lines:
            if not line.startswith(b't') or self.off or not self.node:
                continue
            length = int(line[4:5])
            self.node.send(FRAME.pack(int(line[1:4], 16), length, bytes.fromhex(line[5:5 + 2 * length].decode())))

    def from_node(self, data):
        if len(data) != FRAME.size or self.off:
            return
        identifier, length, content = FRAME.unpack(data)
        self.say(f't{identifier:03X}{length}{content[:length].hex().upper()}\r')


class Slcan(CanRigTest):
    rate_Hz = 100  # a serial adapter, played by Python

    def setUp(self):
        super().setUp()
        shell(f'ip link set {ADAPTER.name} down && ip link set {ADAPTER.name} up')
        self.host = ADAPTER.name

    def node(self, *args):
        bus = self.folder / 'bus'
        node = Node(self.folder, f'unix:{bus}', *args)
        self.ends.append(node.kill)
        ADAPTER.connect(str(bus))
        self.ends.append(ADAPTER.disconnect)
        return node

    def test_bus_off_in_braking(self):
        node = self.node()
        program = self.braking(node)
        ADAPTER.off = True
        ADAPTER.say('sb256256\r')
        self.check_ended(program, 'CAN controller is bus-off')
        self.assertEqual(self.check_zero_in_time(node), 'watchdog')

    def test_error_passive_in_acceleration(self):
        node = self.node()
        program = self.accelerating(node)
        ADAPTER.say('sp050130\r')
        self.check_ended(program, 'CAN controller is error-passive')
        self.check_zero_in_time(node)

    def test_error_warning_is_borne(self):
        node = self.node()
        program = self.braking(node)
        ADAPTER.say('sw100096\r')
        errors = self.finish(program, 0)
        self.assertIn('1 of them warnings', errors)

    def test_bus_off_at_start_is_told_with_its_fix(self):
        self.node()
        ADAPTER.say('sb256256\r')
        errors = ''
        for _ in range(50):
            if 'BUS-OFF' in shell(f'ip -details link show {ADAPTER.name}'):
                break
        errors = self.finish(self.start(), 3)
        self.assertIn('is bus-off', errors)
        self.assertIn(f'sudo ip link set {ADAPTER.name} down && sudo ip link set {ADAPTER.name} up', errors)


if __name__ == '__main__':
    shell('modprobe -a can_raw slcan')
    ADAPTER = Adapter()
    shell(f'ip link set {ADAPTER.name} type can bitrate 500000 restart-ms 0 && ip link set {ADAPTER.name} up')
    unittest.main(verbosity=2)
