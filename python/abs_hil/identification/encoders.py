"""What is wrong with the encoders' readings: discs with unequal slots, and jitter.

Of a disc with unequal slots every second edge comes late by a part s of a count (docs/plants.md). A reading of an even count
then says that the wheel is within 1 + s counts, one of an odd count within 1 - s. Both have their middles at the same place, so
that the slots move no estimate, but

    share of the even counts of a wheel that turns    (1 + s) / 2
    variance of an even reading, an odd one           (1 + s)^2 / 12,  (1 - s)^2 / 12  counts^2

The first line gives s, the second one its readings' weights. A counter may begin anew in each log, at an even edge or at an
odd one: s is the size of the share.

Jitter: a computer that is not of real time reads both encoders a little before or after the time that its log says.

With j the standard deviation of that time, each reading has an error of the same sign in both wheels, of

    g = j speed / count    counts                                     (180 rad/s, 4,096 counts, 10 us: 1.2 counts)

beside the counts' steps. Where the duties rest, third differences from row to row leave next to nothing of the motion, and of
errors that come and go with each row 20 times their covariance. So the mean of both wheels' product, over 20, is

    j^2 speed_1 speed_2 / count^2 + c

where c is what the steps of both counters have in common. A straight line through the means of short blocks gives j.
"""
import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from .logs import Log, Motion
from .parameters import WHEELS

#: at less, a row may not see each count, and the narrow ones are the first to be missed
LEAST_COUNTS_PER_ROW = 4.0
#: speeds near a whole number of pairs of counts a row show the same parity for a while: what scatters is the mean of so long
BLOCK_S = 0.25
#: s, and the square of j, are believed if they are this many standard deviations from 0
SURE = 5.0
LARGEST = 0.9
#: after a change of the motor's duty, or a brake that acted, the motion is smooth again within this time
RESTS_S = 0.3
#: a wheel that turns further from row to row carries its disc's eccentricity into third differences
LARGEST_TURN_RAD = 0.3
#: of the covariance between third differences of errors that come and go with each row: 1 + 9 + 9 + 1
GAIN = 20.0
LEAST_BLOCKS = 8


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


def weighed(logs: Sequence[Log], motions: Sequence[Motion], slots: dict[str, Slots]) -> Iterator[Motion]:
    """The motions with the weights that readings of such discs have."""
    for at, (log, motion) in enumerate(zip(logs, motions)):
        weight = motion.weight.copy()
        for wheel, of in slots.items():
            number = WHEELS.index(wheel)
            parity = _parity(np.nan_to_num(log.counts[:, number]) + log.first_counts[number])
            weight[:, number] /= (1.0 + of.signs[at] * of.error_counts * parity)**2
        yield dataclasses.replace(motion, weight=weight)


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


def jitter_of(logs: Sequence[Log], motions: Sequence[Motion], counts_per_rev: int) -> tuple[float, float]:
    """The standard deviation of the readings' instants, s, of all logs together, 0 if they do not show one; and that of its
    square, over its square."""
    blocks = np.concatenate([_blocks(log, motion, 2 * np.pi / counts_per_rev) for log, motion in zip(logs, motions)])
    if len(blocks) < LEAST_BLOCKS:
        return 0.0, 0.0
    rows, product, covariance = blocks.T
    x = product - np.average(product, weights=rows)
    y = covariance - np.average(covariance, weights=rows)
    information = float(rows @ x**2)
    if not information > 0.0:
        return 0.0, 0.0
    square = float(rows @ (x * y)) / information
    sd = float(np.sqrt((rows * x)**2 @ (y - square * x)**2)) / information
    return (float(np.sqrt(square)), sd / square) if square > SURE * sd else (0.0, 0.0)


def _blocks(log: Log, motion: Motion, per_count_rad: float) -> np.ndarray:
    """Of each block of a log: its rows, the mean product of both speeds, counts^2/s^2, and the mean product of both wheels'
    third differences over GAIN, counts^2. Shape (blocks, 3)."""
    changes = (log.brake_pwm > 0.0) | (np.diff(log.motor_pwm, prepend=log.motor_pwm[0]) != 0.0)
    changes |= np.diff(log.wheels_apart, prepend=log.wheels_apart[0]) != 0.0
    moves = scipy.ndimage.maximum_filter1d(changes, 2 * round(RESTS_S / log.period_s) + 1)
    speed = 0.5 * (motion.speed_rad_s[1:-2] + motion.speed_rad_s[2:-1])
    # Rows that the log itself calls early or late are no jitter.
    third = (np.diff(motion.angle_rad, 3, axis=0) - speed * np.diff(log.time_s, 3)[:, None]) / per_count_rad
    even = np.abs(np.diff(log.time_s) / log.period_s - 1.0) < 0.5
    turn = speed * log.period_s
    used = (even[:-2] & even[1:-1] & even[2:] & ~moves[1:-2] & np.isfinite(third).all(axis=1)
            & ((turn > LEAST_COUNTS_PER_ROW * per_count_rad) & (turn < LARGEST_TURN_RAD)).all(axis=1))
    number = np.floor(log.time_s[1:-2][used] / BLOCK_S)
    number = np.unique(number, return_inverse=True)[1]
    rows = np.bincount(number)
    return np.column_stack([rows, np.bincount(number, np.prod(speed[used] / per_count_rad, axis=1)) / rows,
                            np.bincount(number, np.prod(third[used], axis=1)) / rows / GAIN])
