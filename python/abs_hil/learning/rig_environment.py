"""The gymnasium environment over a rig in real time: one run of the program `abs_hil` an episode."""
import json
import mmap
import pathlib
import signal
import struct
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..options import Value, program, text_of
from .environment import Braking, check_options
from .rigs import CHANGE_PRICE, END_SPEED_M_S, FAULT_REWARD, HIGH, LOW

#: AgentPage of extras/interchange/agent_controller.cpp
MARK = b'absagt01'
PAGE_BYTES = 4096
ACTION_AT, VERSION_AT, VALUES_AT = 16, 24, 32
VALUES = ('time_s', 'slip', 'slip_ref', 'car_speed_m_s', 'alpha1_rad_s2', 'alpha2_rad_s2', 'brake_torque_Nm',
          'max_brake_torque_Nm', 'acting_number', 'late_cycles', 'refused')
#: how often the page is looked at, s
LOOK_S = 0.0005


class RigSlipControl(Braking):
    """Brake a rig in real time, behind the program's command gate and its guardian; on a board or on the simulator.

    `reset` starts `abs_hil`, waits until the rig has run up and braking begins: one run-up an episode. `step` gives an action
    and returns after `period_s` of the rig's time. Observation and action are those of abs_hil.learning.environment.SlipControl.
    Reward: -|estimated slip - wanted slip| - 0.1 |change of the action|; -450 if a fault ends the run.

    An action that comes late changes nothing for `hold_s` after the one before: that one acts on. Then the brake is off until
    an action comes; info["late_cycles"] counts such cycles. Terminated: the run has ended, below 3 m/s or by a fault;
    info["result"] and info["reason"] say how, as in summary.json. Truncated: the program lives on after `longest_s` of braking.

    render_mode: as of SlipControl.
    backend:   "rig" or "sim"; the simulator runs in real time, too.
    set:       configuration values by dotted key, as {"driver.kind": "hm2"}. A real board takes an agent only with
               "unsafe.foreign_controller": True, and what it asks for beside that (docs/rig-setup.md).
    arguments: further words for the program, as ["--plant", "paper-timing"]. folder: where its files are kept; None: nowhere.
    Raises RuntimeError, with the program's words, if a run cannot begin.
    """

    def __init__(self, backend: str = 'rig', *, set: Mapping[str, Value] | None = None, arguments: Sequence[str] = (),
                 period_s: float = 0.01, hold_s: float = 0.03, run_up_s: float = 120.0, longest_s: float = 60.0,
                 folder: str | None = None, render_mode: str | None = None) -> None:
        if not 0.0 < period_s <= hold_s <= 1.0:
            raise ValueError(f'period_s {period_s}, hold_s {hold_s}: give 0 < period_s <= hold_s <= 1')
        super().__init__(render_mode, period_s)
        self._hold_s, self._run_up_s, self._longest_s = hold_s, run_up_s, longest_s
        self._own = tempfile.TemporaryDirectory(prefix='abs_hil_agent_')
        self._folder = pathlib.Path(folder or self._own.name)
        self._page = pathlib.Path(self._own.name) / 'page.agent'
        self._summary = self._folder / 'summary.json'
        values = {'experiment.end_speed_m_s': END_SPEED_M_S, **(set or {})}
        self._command = [program(), '--backend', backend, '--controller', str(self._page), '--no-lcm', '--no-out', '--summary',
                         str(self._summary), *map(str, arguments),
                         *(word for key, value in values.items() for word in ('--set', f'{key}={text_of(value)}'))]
        self._log = self._folder / 'abs_hil.log'
        self._process: subprocess.Popen[bytes] | None = None

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Ends a run that still goes on, and begins another. The rig draws nothing, so the seed has no effect on it.
        It has no options."""
        check_options(options)
        super().reset(seed=seed)
        self._end()
        self._summary.unlink(missing_ok=True)
        self._page.write_bytes(struct.pack('8sd', MARK, self._hold_s).ljust(PAGE_BYTES, b'\0'))
        with open(self._page, 'r+b') as file:
            self._bytes = mmap.mmap(file.fileno(), PAGE_BYTES)
        self._words = np.frombuffer(self._bytes, dtype=np.uint64)
        self._numbers = np.frombuffer(self._bytes, dtype=np.float64, count=len(VALUES), offset=VALUES_AT)
        self._number, self._action = 0, 0.0
        with open(self._log, 'w') as log:
            self._process = subprocess.Popen(self._command, cwd=self._folder, stdin=subprocess.DEVNULL,
                                             stdout=subprocess.DEVNULL, stderr=log)
        deadline = time.monotonic() + self._run_up_s
        while not self._words[VERSION_AT // 8]:
            if self._process.poll() is not None:
                raise RuntimeError(f'no run-up: {self._said()}')
            if time.monotonic() > deadline:
                self._end()
                raise RuntimeError(f'no braking within {self._run_up_s:g} s: raise run_up_s, or see why the rig does not run up')
            time.sleep(LOOK_S)
        self._rows = [self._observe(self._values())]
        return self._rows[0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        asked = float(np.clip(np.asarray(action, dtype=np.float64).reshape(-1)[0], 0.0, 1.0))
        if not np.isfinite(asked):
            raise ValueError('action: give a number in [0, 1]')
        if self._process is None:
            raise RuntimeError('the run has ended: call reset')
        began = self._values()
        self._act(asked)
        change, self._action = abs(asked - self._action), asked
        values, ended = began, False
        while not ended and values['time_s'] < began['time_s'] + self._period_s:
            time.sleep(LOOK_S)
            ended = self._process.poll() is not None
            values = self._values()
        info: dict[str, Any] = {'late_cycles': int(values['late_cycles']), 'slip_est': values['slip']}
        reward = -abs(float(np.clip(values['slip'], -1.0, 1.0)) - values['slip_ref']) - CHANGE_PRICE * change
        if ended:
            info.update(self._outcome())
            if info['result'] != 'completed':
                reward = FAULT_REWARD
            self._process = None
        self._rows.append(self._observe(values))
        return self._rows[-1], reward, ended, not ended and values['time_s'] > self._longest_s, info

    def close(self) -> None:
        """Ends a run as Ctrl-C does: the outputs go to zero."""
        self._end()
        self._own.cleanup()

    def _act(self, action: float) -> None:
        self._number = self._number % 0xFFFFFFFF + 1
        low, = struct.unpack('I', struct.pack('f', action))
        self._words[ACTION_AT // 8] = self._number << 32 | low  # one store: number and action belong together

    def _values(self) -> dict[str, float]:
        """What the program showed last, whole."""
        while True:
            before = int(self._words[VERSION_AT // 8])
            numbers = self._numbers.tolist()
            if before % 2 == 0 and before == int(self._words[VERSION_AT // 8]):
                return dict(zip(VALUES, numbers))

    def _observe(self, v: Mapping[str, float]) -> np.ndarray:
        row = np.array([v['slip'], v['slip_ref'], v['car_speed_m_s'], v['alpha1_rad_s2'], v['alpha2_rad_s2'],
                        v['brake_torque_Nm'] / v['max_brake_torque_Nm'], self._action])
        return np.clip(np.nan_to_num(row), LOW, HIGH).astype(np.float32)

    def _outcome(self) -> dict[str, Any]:
        try:
            summary = json.loads(self._summary.read_text())
        except (OSError, ValueError):
            return {'result': 'died', 'reason': self._said()}
        return {'result': summary['result'], 'reason': summary['reason']}

    def _said(self) -> str:
        assert self._process is not None
        return self._log.read_text().strip() or f'abs_hil ended with status {self._process.returncode}'

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.send_signal(signal.SIGINT)  # nothing if it has ended
            process.wait()
