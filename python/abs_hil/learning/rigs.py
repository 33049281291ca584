"""Simulated rigs for a learner: what it observes, what it is paid, which plants it meets. Needs NumPy only."""
import collections
import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..core import _core
from ..options import PathLike, Value, options
from ..parsers import VARY

#: names of an observation's numbers, with units
OBSERVATION = ('slip_est', 'slip_ref', 'v_x_est_m_s', 'alpha1_rad_s2', 'alpha2_rad_s2', 'brake_torque_est', 'action_before')
LOW = np.array([-1.0, 0.0, 0.0, -3000.0, -1000.0, 0.0, 0.0], dtype=np.float32)
HIGH = np.array([1.0, 1.0, 30.0, 3000.0, 1000.0, 1.0, 1.0], dtype=np.float32)
#: an episode ends below this car speed, where slip is no longer judged
END_SPEED_M_S = 3.0
#: as much as the longest braking, 450 steps of 10 ms, at a slip that is wholly wrong: no fault may pay
FAULT_REWARD = -450.0
#: of a change of the action; chatter between 0 and 1 then costs as much as a slip that is wrong by 0.1
CHANGE_PRICE = 0.1
#: seed of the series of plants on which a learner trains; judge it on another
TRAINING_SEED = 1
_STATE_FAULT = 2.0


@dataclass(frozen=True)
class Task:
    """What is to be learned.

    plant, set:  the nominal plant and configuration values, as in abs_hil.simulate. Encoders, brake lag, PWM steps and the
                 command gate are inside.
    vary:        what varies from episode to episode, as `abs_hil compare --vary`.
    randomise:   further configuration values, drawn uniformly for each episode: {"plant.theta_N": (15, 30)}.
    period_s:    from one action to the next, s; a multiple of the control period (1 ms).
    """
    plant: PathLike = 'paper-timing'
    set: Mapping[str, Value] = field(default_factory=dict)
    vary: str = VARY
    randomise: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    period_s: float = 0.01
    start_speed_rad_s: float = 170.0

    @property
    def cycles(self) -> int:
        """Control periods of an action."""
        rate_Hz = float(self.set.get('control.rate_Hz', 1000.0))
        if (cycles := round(self.period_s * rate_Hz)) < 1:
            raise ValueError(f'period_s {self.period_s}: give at least one control period, {1.0 / rate_Hz} s')
        return cycles


class Rigs:
    """`count` rigs that brake side by side, stepped in C++ threads.

    reset(rig, index) begins an episode of one rig on plant `index` of the series `seed`. step(actions) with actions of
    shape (count,), each the wanted brake torque over the largest, in [0, 1], returns (observations (count, 7), rewards
    (count,), ended (count,)). A rig whose episode has ended stands still until its reset and earns 0.

    Reward of a step: -|slip - slip_ref| (the true slip) - 0.1 |change of the action|; -450 at the end by a fault.

    copy.deepcopy(rigs) and pickle keep the state of all of them; a copy repeats the episode's actions, some milliseconds.

    law: the name of a controller that drives instead of the actions, to compare with.
    """

    def __init__(self, count: int, task: Task | None = None, *, seed: int = TRAINING_SEED, law: str = '',
                 threads: int = 0) -> None:
        self.count = count
        self.task = task or Task()
        self.seed = seed
        self._law = law
        self._threads = threads
        self._cycles = self.task.cycles
        self._episodes = _core.Episodes(count, 1 if count == 1 else threads)
        self._index = np.full(count, -1)
        # What a copy has to repeat: the actions of all rigs, the number of the first of these steps, and of each rig's first.
        self._log: collections.deque[np.ndarray] = collections.deque()
        self._first = 0
        self._begun = np.zeros(count, dtype=np.int64)
        self._action = np.zeros(count)
        self._ended = np.ones(count, dtype=bool)
        self._values = np.full((count, 13), np.nan)

    def reset(self, rig: int, index: int) -> np.ndarray:
        self._begin(rig, index)
        self._index[rig] = index
        self._begun[rig] = self._first + len(self._log)
        while self._first < self._begun.min():
            self._log.popleft()
            self._first += 1
        self._action[rig] = 0.0
        self._ended[rig] = False
        self._read()
        return self.observations()[rig]

    def _begin(self, rig: int, index: int) -> None:
        task = self.task
        drawn = np.random.default_rng([self.seed, index])
        values = {key: float(drawn.uniform(*bounds)) for key, bounds in task.randomise.items()}
        given = options(plant=task.plant, controller=self._law or None,
                        set={'experiment.start_speed_rad_s': task.start_speed_rad_s, **task.set, **values})
        self._episodes.reset(rig, given, task.vary, self.seed, index, bool(self._law))

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name != '_episodes'}

    def __setstate__(self, state: dict[str, object]) -> None:
        """A copy begins each rig's episode again and repeats its actions: exact, as a simulated rig has no chance in it."""
        self.__dict__.update(state)
        self._episodes = _core.Episodes(self.count, 1 if self.count == 1 else self._threads)
        log = np.array(self._log).reshape(-1, self.count)
        for rig in np.flatnonzero(self._index >= 0):
            self._begin(int(rig), int(self._index[rig]))
            self._episodes.replay(int(rig), log[self._begun[rig] - self._first:, rig].copy(), self._cycles)

    def reset_all(self, first: int = 0, plants: int | None = None) -> np.ndarray:
        """Begins an episode of every rig, on the plants first, first + 1, ...; again from first after `plants` of them."""
        for rig in range(self.count):
            self.reset(rig, first + rig % (plants or self.count))
        return self.observations()

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        actions = np.clip(np.asarray(actions, dtype=np.float64).reshape(self.count), 0.0, 1.0)
        if not np.isfinite(actions).all():
            raise ValueError('actions: give numbers in [0, 1]')
        before, done_before = self._action, self._ended.copy()
        self._log.append(actions)
        self._episodes.step(actions, self._cycles)
        self._read()
        values = self._values
        asked = values[:, 10] / values[:, 6] if self._law else actions
        fault = values[:, 12] == _STATE_FAULT
        rewards = -np.abs(np.clip(values[:, 8], -1.0, 1.0) - values[:, 1]) - CHANGE_PRICE * np.abs(asked - before)
        rewards = np.where(fault, FAULT_REWARD, rewards)
        self._action = np.asarray(asked)
        self._ended = done_before | (values[:, 12] != 0.0) | (values[:, 9] < END_SPEED_M_S)
        return self.observations(), np.where(done_before, 0.0, rewards), self._ended.copy()

    def observations(self) -> np.ndarray:
        v = self._values
        rows = np.stack([v[:, 0], v[:, 1], v[:, 2], v[:, 3], v[:, 4], v[:, 5] / v[:, 6], self._action], axis=1)
        return np.clip(np.nan_to_num(rows), LOW, HIGH).astype(np.float32)

    @property
    def true_slip(self) -> np.ndarray:
        return self._values[:, 8].copy()

    def _read(self) -> None:
        with contextlib.suppress(ValueError):  # some rigs have not begun
            self._values = self._episodes.values()
