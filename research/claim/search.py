"""The search for a law's gains: the least slip error on training plants among gains that meet the criteria."""
from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from abs_hil.files import write_text
from abs_hil.tune import PLANTS_SEED, Found, Gain, gains_of, search

from .criteria import PLANTS, SHARE
from .laws import LAWS, Entry, gains_file, judge_entries, run_entries

#: the cost of gains that miss a criterion begins here, above any slip error of gains that meet them
MISSED = 1.0
#: of a criterion that holds on no plant of a kind
PENALTY = 10.0
#: the share that the search demands: the few training plants do not say exactly what share the others will have
MARGIN = 0.05

#: generations and varied plants of each kind. Without lag and encoders the cost hardly depends on the plant.
EFFORT: Mapping[str, tuple[int, int]] = {'real': (24, 12), 'ideal': (12, 6)}

#: training plants of each kind on which the found gains have to show that they count
FURTHER = 100


@dataclass
class TrackingJudge:
    """Cost of gains: the mean slip RMS error over all training plants, plus a penalty where the criteria do not hold.

    Torque variation, time and distance have no part in it: a law that brakes short of the wanted slip gains nothing.
    """
    controller: str
    actuator: str
    plants: Sequence[str] = PLANTS
    cases: int = 12
    threads: int = 0
    evaluations: int = 0
    gains: list[Gain] = field(init=False)

    def __post_init__(self) -> None:
        law = LAWS[self.controller]
        self.gains = [gain for gain in gains_of(self.controller) if gain.name != law.theta0]

    def values(self, point: np.ndarray) -> list[float]:
        return [gain.value_at(float(coordinate)) for gain, coordinate in zip(self.gains, point)]

    def entry(self, values: list[float]) -> Entry:
        return Entry('', self.controller, {gain.name: value for gain, value in zip(self.gains, values)})

    def costs(self, candidates: list[list[float] | None]) -> np.ndarray:
        """Cost of each candidate; the defaults (None) are not judged."""
        all_ = [self.entry(values) for values in candidates if values is not None]
        if not all_:
            return np.full(len(candidates), np.nan)
        figures = run_entries(all_, self.plants, self.actuator, self.cases, PLANTS_SEED, self.threads)
        held = judge_entries(figures, all_, self.plants)
        error = np.where(np.isfinite(figures['slip_rms']), figures['slip_rms'], 1.0).mean(axis=(1, 2))
        # Smooth in the number of plants that fail, so that the search sees the way to gains that count.
        must = (held.stops & held.reaches).mean(axis=-1)
        lacks = (1.0 - must) + np.maximum(0.0, SHARE + MARGIN - held.share()) + 0.1 * ~held.all[..., 0]
        self.evaluations += len(all_)
        missed = lacks.sum(axis=1)
        return np.asarray(error + MISSED * (missed > 1e-9) + PENALTY * missed)


def find_gains(controller: str, actuator: str, folder: pathlib.Path, generations: int | None = None,
               cases: int | None = None, seed: int = 1, threads: int = 0) -> Found:
    """Searches on all plants at once and writes folder/ACTUATOR/CONTROLLER.toml.

    generations, cases (varied plants of each kind): by default those of EFFORT.
    """
    generations, cases = generations or EFFORT[actuator][0], cases or EFFORT[actuator][1]
    judge = TrackingJudge(controller, actuator, PLANTS, cases, threads)
    found = search(judge, generations, seed)
    law = LAWS[controller]
    values = {**law.fixed(), **{gain.name: value for gain, value in zip(judge.gains, found.values)}}
    counted = plants_that_count(Entry('', controller, values), actuator, threads)
    write_gains(gains_file(folder, actuator, controller), controller, values, (
        f'Least slip error with the {actuator} actuator. They count on: {", ".join(counted) or "no plant"} (docs/paper.md).',
        f'Cost {found.cost:.5f} after {found.evaluations} candidates on {cases} plants of each kind, seed {seed}.'))
    return found


def plants_that_count(entry: Entry, actuator: str, threads: int = 0) -> list[str]:
    """Where gains meet the criteria on more training plants than the search had, with a margin for those it never sees."""
    held = judge_entries(run_entries([entry], PLANTS, actuator, FURTHER, PLANTS_SEED, threads), [entry], PLANTS)
    return [plant for plant, counts in zip(PLANTS, held.admissible(SHARE + MARGIN)[0]) if counts]


def write_gains(path: pathlib.Path, controller: str, values: Mapping[str, float], comments: Sequence[str]) -> None:
    """A configuration file (for --config) with these values."""
    tables: dict[str, list[str]] = {}
    for key, value in values.items():
        table, _, name = key.rpartition('.')
        tables.setdefault(table, []).append(f'{name} = {value!r}')
    text = (''.join(f'# {line}\n' for line in comments) + f'[control]\ncontroller = "{controller}"\n' +
            ''.join(f'\n[{table}]\n' + '\n'.join(lines) + '\n' for table, lines in tables.items()))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
