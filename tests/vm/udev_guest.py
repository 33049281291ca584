"""udev_guest.py ABS_HIL: within the virtual machine, with systemd and udev. An emulated RT-DAC/USB2 appears as a USB device
of this kernel. udev's rule starts the resident guardian, which takes the board over, guards a run, and takes the board
over again after it was unplugged with an output on.
"""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'app'))
from emulator_process import EmulatorProcess  # noqa: E402
from program import PROGRAM  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
SERVICE = 'abs-guardian.service'
SAFE = (0.0, 0.0)
UNPLUGGED_S = 3.0


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True)


def is_active():
    return subprocess.run(['systemctl', 'is-active', '--quiet', SERVICE]).returncode == 0


def wait_until(condition, what, seconds=30):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)


def install():
    """What the package installs: programs, unit, configuration, group and udev's rule. Nothing starts the service."""
    for name in ('abs_hil', 'abs_hil_program', 'abs_guardian'):
        pathlib.Path('/usr/local/bin', name).symlink_to(pathlib.Path(PROGRAM).resolve().parent / name)
    for unit in ('abs-guardian.service', 'abs_guardian.slice'):
        shutil.copy(ROOT / 'packaging/systemd' / unit, '/etc/systemd/system')
    shutil.copy(ROOT / 'config/udev/70-abs-hil.rules', '/etc/udev/rules.d')
    pathlib.Path('/etc/abs_hil').mkdir()
    text = (ROOT / 'packaging/guardian.toml').read_text().replace('kind = "pci"', 'kind = "usb"')
    assert 'kind = "usb"' in text
    pathlib.Path('/etc/abs_hil/guardian.toml').write_text(text)
    run('addgroup', '--system', 'abs_hil')
    run('systemctl', 'daemon-reload')
    run('systemctl', 'start', 'systemd-udevd')


def start_run(folder, scope):
    # An emulated processor stands still for some 30 ms now and then.
    return subprocess.Popen(
        ['systemd-run', '--scope', '--quiet', '--collect', f'--unit={scope}', PROGRAM, '--backend', 'rig', '--no-lcm',
         '--no-out', '--recorder', folder, '--rate', '100', '--set', 'driver.kind=usb', '--set', 'driver.emulated=true',
         '--set', 'guardian.resident=require', '--set', 'driver.usb.answer_timeout_us=8000', '--set',
         'realtime.cycle_gap_max_s=0.5', '--set', 'experiment.idle_s=0.02', '--set', 'experiment.cut_speed_rad_s=100'],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def driven_run(board, folder, scope):
    program = start_run(folder, scope)

    def driven():
        assert program.poll() is None, f'ended before it drove: {program.communicate()[1][-1500:]}'
        return board.wire() != SAFE
    wait_until(driven, 'nothing was driven')
    return program


def main():
    folder = pathlib.Path(tempfile.mkdtemp())
    install()
    assert not is_active(), 'the service runs before a board is there'
    board = EmulatorProcess(folder, '--usb')
    wait_until(is_active, 'udev did not start the service')
    print('a board appears: udev starts the service', flush=True)

    program = driven_run(board, folder, 'killed.scope')
    pathlib.Path('/sys/fs/cgroup/system.slice/killed.scope/cgroup.kill').write_text('1')
    wait_until(lambda: board.wire() == SAFE, 'the board holds its duties after cgroup.kill')
    program.communicate()
    print('cgroup.kill of the run: the board is zero', flush=True)

    program = driven_run(board, folder, 'unplugged.scope')
    board.command('unplug')
    said = program.communicate()[1]
    assert program.returncode == 1 and 'unplugged' in said, f'status {program.returncode}: {said[-1500:]}'
    held = board.wire()
    assert held != SAFE, 'the unplugged board is expected to hold its duties'
    time.sleep(UNPLUGGED_S)
    assert board.wire() == held
    board.command('plug')
    wait_until(lambda: board.wire() == SAFE, 'the board holds its duties after it was plugged in again')
    print(f'unplugged with {held}, plugged in after {UNPLUGGED_S} s: the board is zero', flush=True)
    assert is_active()
    board.end()


if __name__ == '__main__':
    try:
        main()
    except AssertionError as problem:
        print(problem)
        print(run('journalctl', '--no-pager', '--output=cat').stdout[-4000:])
        sys.exit(1)
