"""The fixed set of the benchmark (docs/benchmark.md). A change of any case is a new version."""
import hashlib
import json
import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..options import Value

VERSION = 2
#: announced with the version: it draws the random cases
DRAW_SEED = 20_261_123
DRAWN = 24
COMBINED = 21

PLANTS = ('paper-table1', 'paper-timing', 'inteco-manual')
ROADS = {
    'even': '',
    'low': 'braking time: 0.5',
    'jump': 'braking time: 1; 0.521739 at 0.6; 1 at 1',
    'ramp': 'braking time: 1; 0.6 from 0.3 to 0.8',
    'patch': 'braking distance: 1; 0.5 at 4; 1 from 6 to 7',
    'patches': 'braking distance: 1; ' + '; '.join(f'{0.5 if k % 2 else 1} at {2 * k}' for k in range(1, 31)),
}
START_SPEED_RAD_S = 170.0
END_SPEED_M_S = 0.3
#: the wheels coast before each braking, so that a controller may learn the rig's flaws there
COAST_S = 0.5
#: seeds of each case: they place the wheels within a count
SEEDS = (1, 2)


@dataclass(frozen=True)
class Case:
    """One braking.

    plant:  name of the plant. road: a name of ROADS, or any word if the changes have a friction_profile.
    changes: of the plant's values, without `plant.`.
    unknown: the changes that the model does not follow; all other values of the model are the plant's.
    settings: other configuration values.
    """
    group: str
    name: str
    plant: str
    road: str
    start_speed_rad_s: float = START_SPEED_RAD_S
    changes: Mapping[str, Value] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    settings: Mapping[str, Value] = field(default_factory=dict)

    @property
    def key(self) -> str:
        return f'{self.group}/{self.plant}/{self.road}/{self.name}'

    @property
    def profile(self) -> str:
        """The road as `plant.friction_profile`; empty where the friction does not change."""
        return str(self.changes.get('friction_profile', ROADS.get(self.road, '')))

    def plant_values(self) -> dict[str, Value]:
        values: dict[str, Value] = {f'plant.{name}': value for name, value in self.changes.items()}
        if self.profile:
            values['plant.friction_profile'] = self.profile
        return values

    def values(self, nominal: Mapping[str, Value]) -> dict[str, Value]:
        """Configuration values of the run. nominal: the values of the named plant, under their full keys."""
        model = {f'model.{name}': nominal[f'plant.{name}'] for name in (*self.unknown, *_UNTOLD) if name in self.changes}
        return {**self.plant_values(), **model, **self.settings}


#: name -> changes of the plant, whether the model follows them, other settings. The lags are those of time constants of 35
#: and 70 ms instead of 49 ms.
MISMATCHES: dict[str, tuple[dict[str, Value], bool, dict[str, Value]]] = {
    'lag 35 ms': ({'c31_per_s': 1 / 0.035}, False, {}),
    'lag 70 ms': ({'c31_per_s': 1 / 0.070}, False, {}),
    'dead time 2 ms': ({'brake_dead_time_s': 0.002}, False, {}),
    'hysteresis 10 %': ({'brake_hysteresis': 0.1}, False, {}),
    'brake gain 0.8': ({'b1_Nm': 0.8 * 15.24, 'b2_Nm': 0.8 * -6.21}, False, {}),
    'rate 100 N m/s': ({'brake_rate_limit_Nm_s': 100.0}, False, {}),
    'rate 100 N m/s, known': ({'brake_rate_limit_Nm_s': 100.0}, True, {}),
    '1024 counts': ({'encoder_counts_per_rev': 1024}, True, {}),
    'eccentricity 10 mrad': ({'upper_encoder_eccentricity_rad': 0.01, 'upper_encoder_phase_rad': 1.0,
                              'lower_encoder_eccentricity_rad': 0.01, 'lower_encoder_phase_rad': -2.0}, False,
                             {'control.observer.learn_eccentricity_s': 0.4}),
}
#: A drop of friction that meets a slower car locks the wheel whatever the brake does: then the road is even instead.
LEAST_AT_DROP_M_S = 3.0
#: changes that the model had no key for when the set was fixed
_PLANT_ONLY = ('brake_dead_time_s', 'brake_hysteresis')
#: Those of them that it has a key for by now. It is not told them: otherwise the set, which has a checksum, would be another one.
_UNTOLD = ('brake_dead_time_s',)
#: roads of the mismatches
_MISMATCH_ROADS = ('even', 'jump', 'patches')
#: The drivers of the boards send no larger duty by default (docs/rig-setup.md). Gate and controllers know it.
CAPPED: dict[str, Value] = {'brake_duty_max': 0.7}


def _left_m_s(changes: Mapping[str, Value], speed_rad_s: float, road: str) -> float:
    """About how fast the car still is where the road gets slippery, 0 if it stands by then."""
    r2 = 0.099
    slowing = r2 * (r2 * float(changes['theta_N']) + float(changes['M20_Nm'])) / float(changes['J2_kg_m2'])
    v = r2 * speed_rad_s
    left = {'even': 0.0, 'jump': v - 0.6 * slowing, 'patch': math.sqrt(max(v * v - 2.0 * 4.0 * slowing, 0.0))}
    return max(left[road], 0.0)


#: The gate judges the encoders by the largest tyre force that the model believes in, which here is the largest that may be
#: drawn. `nominal`, the only law that uses the model's theta, keeps that of paper-table1.
ANY_TYRE: dict[str, Value] = {'model.theta_N': 60.0, 'control.nominal.theta0_N': 23.0}


def drawn(seed: int, count: int) -> list[Case]:
    """Cases that a seed draws: tyre, road and start at random, wheels and brake within 10 % of the model's."""
    cases = []
    for number in range(count):
        # One generator a case, so that a longer draw has the same first cases; its name is that of version 1, whose cases stay.
        generator = random.Random(f'abs_hil benchmark 1 {seed} {number}')
        near = {'J1_kg_m2': 7.54e-3, 'J2_kg_m2': 25.6e-3, 'd1_Nms_rad': 118.74e-6, 'd2_Nms_rad': 214.68e-6, 'M10_Nm': 0.0032,
                'M20_Nm': 0.0925, 'c31_per_s': 20.37}
        changes: dict[str, Value] = {name: value * generator.uniform(0.9, 1.1) for name, value in near.items()}
        gain = generator.uniform(0.9, 1.1)
        changes |= {'b1_Nm': 15.24 * gain, 'b2_Nm': -6.21 * gain, 'theta_N': generator.uniform(10.0, 60.0),
                    'B': generator.uniform(10.0, 40.0), 'C': generator.uniform(1.3, 1.9)}
        speed = generator.uniform(60.0, 180.0)
        road = generator.choice(('even', 'jump', 'patch'))
        if 0.0 < _left_m_s(changes, speed, road) < LEAST_AT_DROP_M_S:
            road = 'even'
        unknown = tuple(name for name in changes if name != 'theta_N')
        cases.append(Case('drawn', f'{number}', 'paper-table1', road, speed, changes, unknown, ANY_TYRE))
    return cases


def _straight_line(generator: random.Random, from_: float, to: float) -> str:
    begin = generator.uniform(0.1, 0.4)
    return f'braking time: {from_:.2f}; {to:.2f} from {begin:.2f} to {begin + generator.uniform(0.3, 0.8):.2f}'


#: roads of the combined mismatches: each draws a `plant.friction_profile`
COMBINED_ROADS: dict[str, Callable[[random.Random], str]] = {
    'ice': lambda generator: f'braking time: {generator.uniform(0.08, 0.3):.2f}',
    'falling': lambda generator: _straight_line(generator, 1.0, generator.uniform(0.3, 0.6)),
    'rising': lambda generator: _straight_line(generator, generator.uniform(0.3, 0.6), 1.0),
}


def combined(seed: int, count: int) -> list[Case]:
    """Cases with several things wrong at once: coarse encoders, a brake that is faster or slower than the model's, an unknown
    tyre, and a road that is ice or whose friction falls or rises."""
    cases = []
    for number in range(count):
        generator = random.Random(f'abs_hil benchmark combined {seed} {number}')
        road = list(COMBINED_ROADS)[number % len(COMBINED_ROADS)]
        lag_s = generator.uniform(*generator.choice(((0.025, 0.040), (0.060, 0.075))))
        changes: dict[str, Value] = {
            'encoder_counts_per_rev': generator.choice((1024, 2048)), 'c31_per_s': 1.0 / lag_s,
            'theta_N': generator.uniform(20.0, 60.0), 'B': generator.uniform(10.0, 40.0), 'C': generator.uniform(1.3, 1.9)}
        speed = generator.uniform(100.0, 180.0)
        changes['friction_profile'] = COMBINED_ROADS[road](generator)
        cases.append(Case('combined', f'{number}', 'paper-table1', road, speed, changes, ('c31_per_s', 'B', 'C'), ANY_TYRE))
    return cases


def quick_cases() -> list[Case]:
    """A part of the set for quick checks; its score is no score of the benchmark."""
    return [case for case in whole_set() if case.plant != 'paper-timing' and case.road in ('even', 'jump')
            and case.group in ('nominal', 'mismatch') and case.name in ('as it is', 'lag 70 ms', 'eccentricity 10 mrad')]


def whole_set() -> list[Case]:
    nominal = [Case('nominal', 'as it is', plant, road) for plant in PLANTS for road in ROADS]
    speeds = [Case('speeds', f'{speed} rad/s', plant, 'even', float(speed)) for plant in PLANTS for speed in (60, 90, 130)]
    mismatches = [Case('mismatch', name, plant, road, changes=changes,
                       unknown=() if known else tuple(key for key in changes if key not in _PLANT_ONLY), settings=settings)
                  for plant in PLANTS for road in _MISMATCH_ROADS for name, (changes, known, settings) in MISMATCHES.items()]
    capped = [Case('capped', 'duty at most 0.7', plant, road, changes=CAPPED) for plant in PLANTS for road in _MISMATCH_ROADS]
    return [*nominal, *speeds, *mismatches, *drawn(DRAW_SEED, DRAWN), *capped, *combined(DRAW_SEED, COMBINED)]


def checksum() -> str:
    """SHA-256 of everything that the set of this version consists of, bounds apart."""
    of_cases = [[case.key, case.start_speed_rad_s, sorted(case.changes.items()), case.unknown, sorted(case.settings.items()),
                 case.profile] for case in whole_set()]
    return hashlib.sha256(json.dumps([VERSION, END_SPEED_M_S, COAST_S, SEEDS, of_cases]).encode()).hexdigest()
