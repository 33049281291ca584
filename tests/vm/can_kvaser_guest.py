"""Within the virtual machine: driver.kind=can between two emulated Kvaser controllers with the kernel's real driver."""
import subprocess
import unittest

from can_rig import PROGRAM, CanRigTest, put_record, shell


class Kvaser(CanRigTest):
    host, node_side = 'can0', 'can1'

    def setUp(self):
        super().setUp()
        shell('ip link set can0 up && ip link set can1 up')
        put_record(self.folder, self.host)

    def test_0_without_a_record(self):
        (self.folder / f'can-{self.host}.json').unlink()
        node = self.node()
        self.assertIn('has not been commissioned as it is now', self.finish(self.start(), 3))
        self.assertEqual(node.wire(), (0.0, 0.0))

    def test_1_paper(self):
        self.node()
        self.check_paper_run(self.start())
        out = subprocess.run([PROGRAM, 'doctor', '--only', 'can'], capture_output=True, text=True)
        self.assertIn('1000000 bit/s', out.stdout)
        self.assertIn('error-active', out.stdout)

    def test_2_interface_down_in_acceleration(self):
        node = self.node()
        program = self.accelerating(node)
        shell('ip link set can0 down')
        self.check_ended(program, 'CAN interface is down or gone')
        self.assertEqual(self.check_zero_in_time(node), 'watchdog')

    def test_3_too_slow_a_bus_is_refused(self):
        self.node()
        shell('ip link set can0 down && ip link set can0 type can bitrate 500000 && ip link set can0 up')
        try:
            self.assertIn('cannot carry 1000 cycles a second', self.finish(self.start(), 3))
        finally:
            shell('ip link set can0 down && ip link set can0 type can bitrate 1000000')


if __name__ == '__main__':
    shell('modprobe -a can_raw kvaser_pci')
    for interface in ('can0', 'can1'):
        shell(f'ip link set {interface} type can bitrate 1000000')
    unittest.main(verbosity=2)
