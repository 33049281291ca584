"""The environment over a rig in real time: on the simulator, and on the emulated 7I92T behind gate and guardian. Outcomes are
asserted, never this computer's timing."""
import csv
import os
import pathlib
import signal
import socket
import struct
import subprocess
import time

import numpy as np
import pytest

gymnasium = pytest.importorskip('gymnasium')

from conftest import ABS_HIL  # noqa: E402

import abs_hil.learning  # noqa: E402
from abs_hil.learning.rig_environment import RigSlipControl  # noqa: E402
from abs_hil.learning.rigs import FAULT_REWARD  # noqa: E402

#: of board and program: what pauses one pauses both, and neither finds the other silent
CPU = max(os.sched_getaffinity(0))
#: what a busy computer needs
PATIENT = {'realtime.cpu': CPU, 'guardian.timeout_ms': 1000, 'realtime.cycle_gap_max_s': 1, 'realtime.max_consecutive_overruns': 0,
           'realtime.late_max_s': 1000}
START = {'experiment.start_speed_rad_s': 170, **PATIENT}


def drive(environment, policy):
    """One episode: (sum of rewards, last step's info, lowest speed seen)."""
    observation, _ = environment.reset()
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = environment.step(np.array([policy(observation)]))
        assert environment.observation_space.contains(observation)
        total += reward
        over = terminated or truncated
    return total, info, observation[2]


def follow(observation):
    return 0.35 + 2.0 * (observation[1] - observation[0])


@pytest.fixture
def board(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        address = f'127.0.0.1:{probe.getsockname()[1]}'
    control = tmp_path / 'control'
    emulator = subprocess.Popen([pathlib.Path(ABS_HIL).with_name('abs_rig_emulator'), '--control', control, '--cpu', str(CPU),
                                 '--hm2', address],
                                stdout=subprocess.PIPE, text=True)
    for line in emulator.stdout:
        if line.startswith('ready'):
            break

    def say(command):
        with open(control, 'w') as fifo:
            fifo.write(command + '\n')
    yield {'driver.kind': 'hm2', 'driver.hm2.address': address, 'experiment.cut_speed_rad_s': 80, **PATIENT}, say
    emulator.kill()
    emulator.communicate()


def test_an_agent_brakes_a_rig_in_real_time(tmp_path):
    environment = gymnasium.make(abs_hil.learning.RIG_ID, backend='sim', set=START, folder=str(tmp_path),
                                 arguments=('--csv', tmp_path / 'run.csv'))
    total, info, speed_m_s = drive(environment, follow)
    environment.close()
    assert info['result'] == 'completed' and total < 0
    assert speed_m_s < 4.0
    with open(tmp_path / 'run.csv', newline='') as file:
        rows = [row for row in csv.DictReader(file) if row['phase'] == 'brake']
    asked = {float(row['agent_action']) for row in rows}
    assert len(asked) > 20  # its actions, and no law's
    acting = [row for row in rows if float(row['agent_action']) > 0]
    assert all(float(row['agent_age_s']) <= 0.03 + 1e-9 for row in acting)


def test_a_late_action_holds_the_last_and_then_the_brake_is_off(tmp_path):
    environment = RigSlipControl('sim', set=START, folder=str(tmp_path), arguments=('--csv', tmp_path / 'run.csv'))
    observation, _ = environment.reset()
    for _ in range(20):
        observation, *_, info = environment.step([0.3])
    before = info['late_cycles']
    time.sleep(0.2)
    *_, info = environment.step([0.3])
    assert info['late_cycles'] > before + 50
    environment.close()
    with open(tmp_path / 'run.csv', newline='') as file:
        rows = [row for row in csv.DictReader(file) if row['phase'] == 'brake']
    late = [row for row in rows if float(row['agent_age_s']) > 0.03 + 1e-9]
    assert len(late) > 50
    assert all(float(row['agent_action']) == 0.0 for row in late)
    held = [row for row in rows if 0.012 < float(row['agent_age_s']) <= 0.029]
    assert any(float(row['agent_action']) == pytest.approx(0.3, abs=1e-6) for row in held)


@pytest.mark.parametrize('action', [np.nan, -1.0, 5.0])
def test_an_agent_cannot_ask_for_more_than_the_brake_has(action, tmp_path):
    """What the environment clips, a raw page may hold; the program refuses it."""
    environment = RigSlipControl('sim', set=START, folder=str(tmp_path))
    environment.reset()
    environment._act(action)
    time.sleep(0.05)
    values = environment._values()
    environment.close()
    assert values['refused'] == 1 and values['acting_number'] == 0 and values['brake_torque_Nm'] < 1.0


def test_a_number_is_asked_for(tmp_path):
    environment = RigSlipControl('sim', set=START, folder=str(tmp_path))
    environment.reset()
    with pytest.raises(ValueError, match='give a number in'):
        environment.step([np.nan])
    _, reward, *_ = environment.step([0.2])
    assert np.isfinite(reward)
    environment.close()


@pytest.mark.parametrize('hold_s', [1e9, np.nan])
def test_an_agent_cannot_make_its_actions_last_longer_during_a_run(hold_s, tmp_path):
    environment = RigSlipControl('sim', set=START, folder=str(tmp_path))
    environment.reset()
    struct.pack_into('d', environment._bytes, 8, hold_s)
    environment._act(0.3)
    time.sleep(0.2)
    values = environment._values()
    environment.close()
    assert values['late_cycles'] > 50 and values['acting_number'] == 0


def test_behind_gate_and_guardian_of_a_board(board, tmp_path):
    settings, say = board
    environment = RigSlipControl('rig', set=settings, folder=str(tmp_path))
    for _ in range(2):  # one reset is one run-up
        _, info, speed_m_s = drive(environment, follow)
        assert info['result'] == 'completed', info
        assert speed_m_s < 4.0
    environment.reset()
    environment.step([0.2])
    say('bite')
    terminated = False
    for _ in range(100):
        _, reward, terminated, _, info = environment.step([0.2])
        if terminated:
            break
    assert terminated and reward == FAULT_REWARD
    assert info['result'] == 'fault' and 'watchdog' in info['reason']
    with pytest.raises(RuntimeError, match='call reset'):
        environment.step([0.2])
    environment.close()


def test_a_program_that_dies_ends_the_episode(tmp_path):
    environment = RigSlipControl('sim', set=START, folder=str(tmp_path))
    environment.reset()
    os.kill(environment._process.pid, signal.SIGKILL)
    for _ in range(100):
        _, reward, terminated, _, info = environment.step([0.2])
        if terminated:
            break
    assert terminated and reward == FAULT_REWARD and info['result'] == 'died'
    environment.close()


def test_what_cannot_run_is_said(tmp_path):
    with pytest.raises(ValueError, match='period_s 0.1, hold_s 0.03'):
        RigSlipControl('sim', period_s=0.1)
    environment = RigSlipControl('sim', set={'plant.theta_N': -1}, folder=str(tmp_path))
    with pytest.raises(RuntimeError, match='plant.theta_N'):
        environment.reset()
    environment.close()
    page = tmp_path / 'no.agent'
    for content in (b'', bytes(4096), b'absagt01' + bytes(4088)):
        page.write_bytes(content)
        result = subprocess.run([ABS_HIL, '--fast', '--no-lcm', '--no-out', '--controller', page], capture_output=True, text=True)
        assert result.returncode == 2 and 'no.agent' in result.stderr
