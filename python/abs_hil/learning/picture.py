"""What `render` shows: the episode so far as a picture."""
import numpy as np

from ..places import how_to_install
from .rigs import OBSERVATION

MODES = ('rgb_array',)


class EpisodePicture:
    """Slip and reference, speed, and action over the time of one episode. `begin` and `add` keep its observations."""

    def __init__(self, render_mode: str | None, period_s: float) -> None:
        if render_mode not in (None, *MODES):
            raise ValueError(f'render_mode {render_mode!r}: give one of {", ".join(MODES)}, or None')
        self._wanted = render_mode is not None
        self._period_s = period_s
        self._rows: list[np.ndarray] = []

    def begin(self, observation: np.ndarray) -> None:
        self._rows = []
        self.add(observation)

    def add(self, observation: np.ndarray) -> None:
        if self._wanted:
            self._rows.append(observation)

    def draw(self) -> np.ndarray | None:
        """The picture, uint8 of shape (480, 640, 3); None without a render_mode."""
        if not self._wanted:
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
