"""Jitter: a computer that is not of real time reads both encoders a little before or after the time that its log says.

With j the standard deviation of that time, each reading has an error of the same sign in both wheels, of

    g = j speed / count    counts                                     (180 rad/s, 4,096 counts, 10 us: 1.2 counts)

beside the counts' steps. Where the duties rest, third differences from row to row leave next to nothing of the motion, and of
errors that come and go with each row 20 times their covariance. So the mean of both wheels' product, over 20, is

    j^2 speed_1 speed_2 / count^2 + c

where c is what the steps of both counters have in common. A straight line through the means of short blocks gives j.
"""
from collections.abc import Sequence

import numpy as np
import scipy.ndimage

from .logs import Log, Motion
from .slots import BLOCK_S, LEAST_COUNTS_PER_ROW

#: after a change of the motor's duty, or a brake that acted, the motion is smooth again within this time
RESTS_S = 0.3
#: a wheel that turns further from row to row carries its disc's eccentricity into third differences
LARGEST_TURN_RAD = 0.3
#: of the covariance between third differences of errors that come and go with each row: 1 + 9 + 9 + 1
GAIN = 20.0
LEAST_BLOCKS = 8
#: j is believed if its square is this many standard deviations above 0
SURE = 5.0


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
    if not used.any():
        return np.empty((0, 3))
    number = np.floor(log.time_s[1:-2][used] / BLOCK_S)
    number = np.unique(number, return_inverse=True)[1]
    rows = np.bincount(number)
    return np.column_stack([rows, np.bincount(number, np.prod(speed[used] / per_count_rad, axis=1)) / rows,
                            np.bincount(number, np.prod(third[used], axis=1)) / rows / GAIN])
