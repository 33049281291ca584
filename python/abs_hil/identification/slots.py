"""Encoder discs with unequal slots: every second edge comes late by a part s of a count (docs/plants.md).

A reading of an even count then says that the wheel is within 1 + s counts, one of an odd count within 1 - s. Both have their
middles at the same place, so that the slots move no estimate, but

    share of the even counts of a wheel that turns    (1 + s) / 2
    variance of an even reading, an odd one           (1 + s)^2 / 12,  (1 - s)^2 / 12  counts^2

The first line gives s, the second one its readings' weights. A counter may begin anew in each log, at an even edge or at an
odd one: s is the size of the share.
"""
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .logs import Log, Motion
from .parameters import WHEELS

#: at less, a row may not see each count, and the narrow ones are the first to be missed
LEAST_COUNTS_PER_ROW = 4.0
#: speeds near a whole number of pairs of counts a row show the same parity for a while: what scatters is the mean of so long
BLOCK_S = 0.25
#: s is believed if it is this many standard deviations from 0
SURE = 5.0
LARGEST = 0.9


@dataclass(frozen=True)
class Slots:
    """Of one wheel's disc: s in counts and its standard deviation; signs: of each log, 1 where its even counts are the wide
    ones."""
    error_counts: float
    sd_counts: float
    signs: tuple[int, ...]


def slots_of(logs: Sequence[Log], motions: Sequence[Motion], counts_per_rev: int) -> dict[str, Slots]:
    """Those of the wheels whose logs show them: surely, and in each log as the others say."""
    found = {}
    for number, wheel in enumerate(WHEELS):
        sums, squares, rows = np.zeros((3, len(logs)))
        for at, (log, motion) in enumerate(zip(logs, motions)):
            per_row = motion.speed_rad_s[:, number] * log.period_s * counts_per_rev / (2 * np.pi)
            turns = (np.abs(per_row) > LEAST_COUNTS_PER_ROW) & np.isfinite(log.counts[:, number])
            if not turns.any():
                continue
            parity = _parity(log.counts[turns, number] + log.first_counts[number])
            blocks = np.floor(log.time_s[turns] / BLOCK_S)
            blocks = (blocks - blocks.min()).astype(int)
            sums[at], rows[at] = parity.sum(), len(parity)
            left = np.bincount(blocks, parity - parity.mean())
            squares[at] = max(float(left @ left), len(parity))
        signs = np.where(sums < 0.0, -1, 1)
        s = float(np.abs(sums).sum() / max(rows.sum(), 1.0))
        sd = float(np.sqrt(squares.sum()) / max(rows.sum(), 1.0))
        if SURE * sd < s < LARGEST and _foretold(np.abs(sums), rows):
            found[wheel] = Slots(s, sd, tuple(signs.tolist()))
    return found


def weighed(logs: Sequence[Log], motions: Sequence[Motion], slots: dict[str, Slots]) -> list[Motion]:
    """The motions with the weights that readings of such discs have."""
    out = []
    for at, (log, motion) in enumerate(zip(logs, motions)):
        weight = motion.weight.copy()
        for wheel, of in slots.items():
            number = WHEELS.index(wheel)
            parity = _parity(np.nan_to_num(log.counts[:, number]) + log.first_counts[number])
            weight[:, number] /= (1.0 + of.signs[at] * of.error_counts * parity)**2
        out.append(dataclasses.replace(motion, weight=weight))
    return out


def middles(exact_counts: np.ndarray, error_counts: np.ndarray) -> np.ndarray:
    """Of the counts that a disc shows at these places, which are counts from an even edge; shapes that broadcast."""
    edge = np.floor(exact_counts)
    late = (_parity(edge) < 0.0) & (exact_counts - edge < error_counts)
    return np.asarray(edge - late + 0.5 * (1.0 + error_counts))


def _parity(counts: np.ndarray) -> np.ndarray:
    """1 of even counts, -1 of odd ones."""
    return 1.0 - 2.0 * (np.asarray(counts) % 2.0)


def _foretold(sums: np.ndarray, rows: np.ndarray) -> bool:
    """Whether the logs are likelier with the s of all the others than with none; a single log with its own."""
    others = len(rows) > 1
    s = (sums.sum() - others * sums) / np.maximum(rows.sum() - others * rows, 1.0)
    s = np.clip(s, -LARGEST, LARGEST)
    gain = 0.5 * (rows + sums) * np.log1p(s) + 0.5 * (rows - sums) * np.log1p(-s)
    return bool(gain.sum() > 0.0)
