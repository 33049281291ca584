"""live sees a run over LCM. In a network namespace of its own, with a server that a test may start: tcpq has none."""
import os
import pathlib
import shutil
import subprocess
import sys

import pytest
from conftest import ABS_HIL

import abs_hil

PRIVATE = pathlib.Path(__file__).parents[2] / 'scripts' / 'in_private_network.sh'
RECEIVER = '''
import subprocess, sys, abs_hil
messages = abs_hil.live(timeout_s=20)
first_of_other = abs_hil.live(channel='EXPERIMENT', timeout_s=20)
run = subprocess.Popen([sys.argv[1], '--backend', 'sim', '--rt', 'off', '--no-out', '--set', 'realtime.cycle_gap_max_s=10',
                        '--csv', sys.argv[2], '--set',
                        'experiment.start_speed_rad_s=40'], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
experiment = next(first_of_other)
seen = []
for message in messages:
    seen.append(message.cycle)
    if message.phase == message.PHASE_STOPPED:
        break
run.wait()
rows = sum(1 for _ in open(sys.argv[2])) - 1
print(experiment.experiment, len(seen), rows)
'''


def test_live(tmp_path):
    probe = subprocess.run(['unshare', '-n', 'true'], capture_output=True, check=False)
    if probe.returncode != 0 or not shutil.which('ip'):
        pytest.skip('no network namespaces here')
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    result = subprocess.run([PRIVATE, sys.executable, '-c', RECEIVER, ABS_HIL, tmp_path / 'run.csv'], check=False,
                            capture_output=True, text=True, timeout=120, env=environment)
    assert result.returncode == 0, result.stderr
    name, seen, rows = result.stdout.split()
    assert name == 'paper'
    assert 0.5 * int(rows) < int(seen) <= int(rows), result.stdout


def test_bad_network():
    with pytest.raises(ValueError, match='nonsense'):
        next(abs_hil.live('nonsense'))
    with pytest.raises(OSError, match='carrier-pigeon'):
        next(abs_hil.live('carrier-pigeon://x'))


def test_silence_ends_the_iteration():
    assert list(abs_hil.live('memq://', timeout_s=0.05)) == []


def test_an_installation_without_network_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, 'abs_hil._network', None)  # as a wheel
    for use in (abs_hil.live, lambda: abs_hil.simulate('law.so')):
        with pytest.raises(OSError, match=r'needs the module abs_hil\._network.*pip install \.'):
            use()
