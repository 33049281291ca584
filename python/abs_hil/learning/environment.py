"""The gymnasium environments over simulated rigs, and the picture that `render` shows."""
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector.utils import batch_space

from ..places import how_to_install
from .rigs import HIGH, LOW, OBSERVATION, TRAINING_SEED, Rigs, Task

try:
    from gymnasium.vector import AutoresetMode, VectorEnv
except ImportError:
    newer = how_to_install("'gymnasium>=1.1'")
    raise ImportError(f'abs_hil.learning: gymnasium {gymnasium.__version__} is too old; install a newer one: {newer}') from None

#: the longest braking takes about 450 steps of 10 ms
MOST_STEPS = 1000
MODES = ('rgb_array',)


class Braking(gymnasium.Env):
    """What environments of one rig share: their spaces, and a picture of slip and reference, speed, and action over the time of
    one episode, whose observations are its `_rows`."""

    metadata: dict[str, Any] = {'render_modes': list(MODES)}

    def __init__(self, render_mode: str | None, period_s: float) -> None:
        if render_mode not in (None, *MODES):
            raise ValueError(f'render_mode {render_mode!r}: give one of {", ".join(MODES)}, or None')
        self.render_mode = render_mode
        self.observation_space, self.action_space = spaces()
        self.metadata = {**self.metadata, 'render_fps': round(1.0 / period_s)}
        self._period_s = period_s
        self._rows: list[np.ndarray] = []

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """The picture, uint8 of shape (480, 640, 3); None without a render_mode."""
        if self.render_mode is None:
            return None
        try:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
        except ImportError:
            raise ImportError(f'render: needs matplotlib; install it: {how_to_install("matplotlib")}') from None
        columns = dict(zip(OBSERVATION, np.reshape(self._rows, (-1, len(OBSERVATION))).T))
        time_s = self._period_s * np.arange(len(self._rows))
        figure = Figure(figsize=(6.4, 4.8), dpi=100, layout='constrained')
        slip, speed, action = figure.subplots(3, 1, sharex=True)
        slip.plot(time_s, columns['slip_est'], label='estimated')
        slip.plot(time_s, columns['slip_ref'], '--', label='wanted')
        slip.set(ylabel='slip', ylim=(-0.05, 1.05))
        slip.legend(loc='upper right')
        speed.plot(time_s, columns['v_x_est_m_s'])
        speed.set(ylabel='speed / (m/s)', ylim=(0, None))
        action.step(time_s, columns['action_before'], where='pre')
        action.set(ylabel='action', ylim=(-0.05, 1.05), xlabel='time / s')
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def spaces() -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """Of observations and of actions."""
    return gymnasium.spaces.Box(LOW, HIGH, dtype=np.float32), gymnasium.spaces.Box(np.float32(0), np.float32(1), (1,), np.float32)


def check_options(options: Mapping[str, Any] | None, *known: str) -> None:
    """Raises ValueError for an option of `reset` that the environment does not have."""
    for name in options or ():
        if name not in known:
            raise ValueError(f'options: this environment has no option {name!r}; its options: {", ".join(known) or "none"}. '
                             'Configuration values go into gymnasium.make(..., set={...})')


class SlipControl(Braking):
    """Brake one simulated rig to 3 m/s and keep the wheel's slip at its reference.

    Observation, float32 of shape (7,), as the program's controllers get it, from encoder counts:
        0 slip_est          estimated slip, in [-1, 1]
        1 slip_ref          wanted slip, in [0, 1]
        2 v_x_est_m_s       estimated speed of the car, m/s, in [0, 30]
        3 alpha1_rad_s2     estimated acceleration of the braked wheel, rad/s^2, in [-3000, 3000]
        4 alpha2_rad_s2     estimated acceleration of the lower wheel, rad/s^2, in [-1000, 1000]
        5 brake_torque_est  torque estimated to act behind the brake's lag, over the largest, in [0, 1]
        6 action_before     the action before, in [0, 1]
    Action, float32 of shape (1,): the wanted brake torque over the largest, in [0, 1], held for `period_s`.
    Reward of a step: -|true slip - slip_ref| - 0.1 |change of the action|; -450 if a fault ends the run, which is more than any
    braking costs.
    Terminated: the car is below 3 m/s, or a fault has ended the run. Truncated after 1000 steps.

    copy.deepcopy(env) and pickle keep its state, for a search that branches; a copy repeats the episode's actions, which takes
    some milliseconds.

    Every episode has another plant: see abs_hil.learning.Task (plant, set, vary, randomise, period_s, start_speed_rad_s),
    whose fields are this environment's arguments. The same seed of `reset` gives the same plants.

    render_mode "rgb_array": render() returns the episode so far as a picture, uint8 of shape (480, 640, 3).
    """

    def __init__(self, plants_seed: int = TRAINING_SEED, render_mode: str | None = None, **task: Any) -> None:
        self._rigs = Rigs(1, Task(**task), seed=plants_seed)
        super().__init__(render_mode, self._rigs.task.period_s)

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """options: {"index": n} chooses plant n of the series."""
        check_options(options, 'index')
        super().reset(seed=seed)
        index = int(options['index']) if options else int(self.np_random.integers(2**31))
        self._rows = [self._rigs.reset(0, index)]
        return self._rows[0], {'index': index}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        observations, rewards, ended = self._rigs.step(np.asarray(action))
        self._rows.append(observations[0])
        return (observations[0], float(rewards[0]), bool(ended[0]), not ended[0] and len(self._rows) > MOST_STEPS,
                {'true_slip': float(self._rigs.true_slip[0])})


class SlipControlVector(VectorEnv):
    """Many rigs of SlipControl, stepped in C++ threads. A rig whose episode has ended begins another at the next step."""

    def __init__(self, num_envs: int = 1, plants_seed: int = TRAINING_SEED, render_mode: str | None = None,
                 threads: int = 0, **task: Any) -> None:
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space, self.single_action_space = spaces()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {'autoreset_mode': AutoresetMode.NEXT_STEP, 'render_modes': []}
        self._rigs = Rigs(num_envs, Task(**task), seed=plants_seed, threads=threads)
        self._steps = np.zeros(num_envs, dtype=int)
        self._over = np.zeros(num_envs, dtype=bool)
        self._plants = np.zeros(num_envs, dtype=np.int64)

    def reset(self, *, seed: Any = None, options: Mapping[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """options: {"index": [n, ...]} chooses the plant of each rig."""
        check_options(options, 'index')
        super().reset(seed=seed)
        self._over[:] = False
        self._steps[:] = 0
        if options:
            self._plants = np.broadcast_to(np.asarray(options['index'], dtype=np.int64), (self.num_envs,)).copy()
        else:
            self._plants = self.np_random.integers(2**31, size=self.num_envs)
        for rig, index in enumerate(self._plants):
            self._rigs.reset(rig, int(index))
        return self._rigs.observations(), self._info()

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        again = self._over.copy()
        observations, rewards, ended = self._rigs.step(np.asarray(actions).reshape(self.num_envs))
        for rig in np.flatnonzero(again):
            self._plants[rig] = self.np_random.integers(2**31)
            self._rigs.reset(int(rig), int(self._plants[rig]))
        if again.any():
            observations = self._rigs.observations()
        self._steps = np.where(again, 0, self._steps + 1)
        terminated = ended & ~again
        truncated = ~terminated & (self._steps >= MOST_STEPS)
        self._over = terminated | truncated
        return observations, np.where(again, 0.0, rewards), terminated, truncated, self._info()

    def _info(self) -> dict[str, Any]:
        """As gymnasium's vectors have it: of each rig the number of its plant and its true slip."""
        there = np.ones(self.num_envs, dtype=bool)
        return {'index': self._plants.copy(), '_index': there, 'true_slip': self._rigs.true_slip, '_true_slip': there.copy()}
