"""In the guest: the way to a card's registers through sysfs, on QEMU's pci-testdev, whose BAR 1 has 256 I/O ports.

usage: pci_guest.py PROGRAM locked|open
The test device is no RT-DAC4/PCI, so a folder with the card's ids in front of the device's own files stands for the
card. Every access goes through the kernel's own file.
"""
import os
import pathlib
import struct
import subprocess
import sys
import time

PROGRAM, LOCKDOWN = sys.argv[1:3]
TREE = pathlib.Path('/run/tree/sys/bus/pci/devices')
CARD = TREE / '0000:03:00.0'
TEST, OFFSET, COUNT = 1, 132, 12  # of pci-testdev: the test whose writes of any size count, where they go, their count


def check(holds, what, *shown):
    if not holds:
        sys.exit(f'FAILED: {what}: {shown}')
    print(f'ok: {what}', *shown, flush=True)


def find_device():
    for folder in pathlib.Path('/sys/bus/pci/devices').iterdir():
        if (folder / 'vendor').read_text().strip() == '0x1b36' and (folder / 'device').read_text().strip() == '0x0005':
            return folder
    sys.exit('FAILED: no pci-testdev in the guest')


def make_card(device):
    CARD.mkdir(parents=True)
    (CARD / 'vendor').write_text('0x10b5\n')
    (CARD / 'device').write_text('0x2497\n')
    regions = (device / 'resource').read_text().splitlines()
    print('pci-testdev:', regions[1])
    (CARD / 'resource').write_text('\n'.join([regions[0], regions[0], regions[1]]) + '\n')
    (CARD / 'resource2').symlink_to(device / 'resource1')
    (CARD / 'enable').symlink_to(device / 'enable')
    (TREE.parents[2] / 'kernel').symlink_to('/sys/kernel')


def words_of(*args):
    result = subprocess.run([PROGRAM, *args, '--set', f'driver.pci.root={TREE}'], capture_output=True, text=True)
    said = result.stdout + result.stderr
    print(f'--- abs_hil {args[0]}: status {result.returncode}\n{said}', flush=True)
    return result.returncode, said


def refused(error, access):
    try:
        access()
    except OSError as problem:
        return problem.errno == error
    return False


def read32(file, offset):
    return struct.unpack('<I', os.pread(file, 4, offset))[0]


def counted(file, wanted):
    """Whether the device counts so many writes; it counts them in another thread of QEMU."""
    for _ in range(100):
        if read32(file, COUNT) == wanted:
            return True
        time.sleep(0.02)
    return False


def registers(device):
    (device / 'enable').write_text('1\n')
    file = os.open(CARD / 'resource2', os.O_RDWR)
    check(os.pwrite(file, struct.pack('<I', TEST), 0) == 4, 'a 32-bit write to port 0 begins a test')
    check(os.pread(file, 4, 16) == b'port', 'a 32-bit read has four bytes of its name', os.pread(file, 4, 16))
    for n in range(1, 4):
        os.pwrite(file, struct.pack('<I', 0x01020304), OFFSET)
        check(counted(file, n), 'a 32-bit write arrives once, and a 32-bit read shows it', n)
    for size in (3, 8, 16):
        check(refused(22, lambda size=size: os.pread(file, size, 0)), f'a read of {size} bytes is refused (EINVAL)')
        check(refused(22, lambda size=size: os.pwrite(file, bytes(size), OFFSET)), f'a write of {size} bytes is refused')
    time.sleep(0.2)
    count = read32(file, COUNT)
    check(count == 3, 'refused writes do not arrive', count)
    check(len(os.pread(file, 4, 254)) == 2, 'a read across the end of the ports is cut, which the driver takes for an error')

    status, said = words_of('doctor', '--backend', 'rig', '--only', 'backend')
    check(status == 3 and 'encoder counters, and the rig needs 2' in said and 'nothing was written' in said,
          'doctor: this is no card with ABS logic')
    status, said = words_of('--backend', 'rig', '--no-lcm', '--rt', 'off')
    check(status == 3 and 'encoder counters, and the rig needs 2' in said, 'a run: the same')
    check(read32(file, COUNT) == count, 'neither has written')
    os.close(file)

    (device / 'enable').write_text('0\n')
    file = os.open(CARD / 'resource2', os.O_RDWR)
    print('ports of the disabled device read 0x%08x: the kernel has not switched them off' % read32(file, 0))
    os.close(file)
    for args in (('doctor', '--backend', 'rig', '--only', 'backend'), ('--backend', 'rig', '--no-lcm', '--rt', 'off')):
        status, said = words_of(*args)
        check(status == 3 and 'not enabled' in said and f'sudo tee {CARD}/enable' in said,
              f'{args[0]}: a disabled device is named, with the command')
    # The kernel does not switch the ports off, so zeros may still reach a card. This device does not show them.
    status, said = words_of('safe', '--insist', '0')
    check(status == 1 and 'does not read back what was written' in said, 'safe: it writes, and sees that it is no card')


def locked(device):
    (device / 'enable').write_text('1\n')
    level = pathlib.Path('/sys/kernel/security/lockdown').read_text().strip()
    check('[integrity]' in level, 'the kernel is locked down', level)
    file = os.open(CARD / 'resource2', os.O_RDWR)
    print('open succeeds; a read gives 0x%08x' % read32(file, 0))
    check(refused(1, lambda: os.pwrite(file, struct.pack('<I', 0), 0)), 'a write is refused (EPERM)')
    os.close(file)
    for args in (('doctor', '--backend', 'rig', '--only', 'boards'), ('doctor', '--backend', 'rig', '--only', 'backend'),
                 ('--backend', 'rig', '--no-lcm', '--rt', 'off')):
        status, said = words_of(*args)
        check(status == 3 and 'the kernel is locked down (Secure Boot)' in said, f'{args}: lockdown is named')
    # Without the kernel's own word, the refused write tells.
    (TREE.parents[2] / 'kernel').unlink()
    status, said = words_of('safe', '--insist', '0')
    check(status == 1 and 'the system refuses the access' in said and 'Operation not permitted' in said,
          'safe: a refused write is named')


def main():
    subprocess.run(['mount', '-t', 'securityfs', 'none', '/sys/kernel/security'], check=False)
    device = find_device()
    make_card(device)
    (locked if LOCKDOWN == 'locked' else registers)(device)


if __name__ == '__main__':
    main()
