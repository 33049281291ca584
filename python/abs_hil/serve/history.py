"""What the scope remembers, in memory that is allocated once: the newest cycles whole, and of a longer time the least and
the greatest value of every signal in each fiftieth of a second."""
from collections.abc import Sequence

import numpy as np

from ..messages import MOST_SIGNALS, QUANTITIES

#: length of a bin: 50 a second
BIN_S = 0.02
#: what the server itself computes (feed.py)
DERIVED = ('tyre_slip', 'tyre_force_N')
#: columns of the quantities; then come the places of a controller's own signals, then DERIVED
COLUMNS = tuple(QUANTITIES)
PLACE = {name: place for place, name in enumerate(COLUMNS)}
WIDTH = len(COLUMNS) + MOST_SIGNALS + len(DERIVED)
DERIVED_PLACE = WIDTH - len(DERIVED)
#: 10 minutes of bins; 2 minutes of cycles at 1 kHz
BINS, ROWS = 30_000, 120_000


class Ring:
    """The newest `size` rows of a table. Rows are numbered from the first ever added."""

    def __init__(self, size: int, *shape: int) -> None:
        self.size = size
        self.head = 0  # number of the next row
        # Filled at once: the memory does not grow later.
        self.run = np.full(size, -1, dtype=np.int32)
        self.values = np.full((size, *shape), np.nan)

    @property
    def tail(self) -> int:
        return max(0, self.head - self.size)

    def add(self, run: int, values: np.ndarray) -> None:
        values = values[-self.size:]
        places = np.arange(self.head, self.head + len(values)) % self.size
        self.values[places] = values
        self.run[places] = run
        self.head += len(values)

    def places(self, first: int, end: int) -> np.ndarray:
        return np.arange(max(first, self.tail), min(end, self.head)) % self.size


class History:
    """cycles: rows of WIDTH values. bins: rows of (least, greatest, number of the bin since the run's start) by WIDTH; the
    third has one value."""

    def __init__(self, bins: int = BINS, rows: int = ROWS) -> None:
        self.cycles = Ring(rows, WIDTH)
        self.bins = Ring(bins, 2, WIDTH)
        self.numbers = np.zeros(bins, dtype=np.int32)
        self._run = -1
        self._open: tuple[int, np.ndarray] | None = None  # the bin that still grows

    def add(self, run: int, rows: np.ndarray) -> None:
        """Adds the rows of consecutive cycles, of shape (cycles, WIDTH)."""
        if run != self._run:
            self.close_bin()
            self._run = run
        self.cycles.add(run, rows)
        numbers = bin_numbers(rows[:, PLACE['time_s']])
        starts = np.concatenate(([0], np.flatnonzero(np.diff(numbers)) + 1))
        lows, highs = np.fmin.reduceat(rows, starts, axis=0), np.fmax.reduceat(rows, starts, axis=0)
        for start, low, high in zip(starts.tolist(), lows, highs):
            number = int(numbers[start])
            if self._open is not None and self._open[0] == number:
                envelope = self._open[1]
                np.fmin(envelope[0], low, out=envelope[0])
                np.fmax(envelope[1], high, out=envelope[1])
                continue
            self.close_bin()
            self._open = (number, np.stack((low, high)))

    def close_bin(self) -> None:
        """Ends the bin that grows: the next one has begun, or no message came for a while."""
        if self._open is None:
            return
        number, envelope = self._open
        self._open = None
        self.numbers[self.bins.head % self.bins.size] = number
        self.bins.add(self._run, envelope[np.newaxis])

    def rows_of(self, run: int, from_s: float, to_s: float, most: int) -> np.ndarray:
        """The cycles of a run within a time, the oldest `most` of them."""
        cycles = self.cycles
        times = cycles.values[:, PLACE['time_s']]
        kept = np.flatnonzero((cycles.run == run) & (times >= from_s) & (times <= to_s))
        kept = kept[np.argsort(cycles.values[kept, PLACE['cycle']], kind='stable')][:most]
        return cycles.values[kept]


def bin_numbers(time_s: np.ndarray) -> np.ndarray:
    return np.floor(time_s / BIN_S + 1e-6).astype(np.int64)


def own_place(names: Sequence[str], name: str) -> int | None:
    """Column of a signal in a run whose controller's own signals are `names`; None if the run lacks it."""
    if name in PLACE:
        return PLACE[name]
    if name in DERIVED:
        return DERIVED_PLACE + DERIVED.index(name)
    return len(COLUMNS) + list(names).index(name) if name in names else None
