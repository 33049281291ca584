"""Checks a result file of the benchmark: all its runs are made again (docs/benchmark.md)."""
from __future__ import annotations

import math
import pathlib
from collections.abc import Mapping
from typing import Any

from ..nesting import parse_json
from . import bounds, cases
from .score import Entry, run

#: what a figure may differ by, relative: another compiler may round differently
TOLERANCE = 1e-6


def _equal(stored: Any, fresh: Any) -> bool:
    if isinstance(fresh, float) and math.isnan(fresh):
        return stored is None
    if isinstance(fresh, (int, float)) and isinstance(stored, (int, float)):
        return math.isclose(stored, fresh, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
    return bool(stored == fresh)


def _differences(what: str, stored: Mapping[str, Any], fresh: Mapping[str, Any]) -> list[str]:
    return [f'{what}: {name} is {stored.get(name)}, a fresh run gives {value}'
            for name, value in fresh.items() if not _equal(stored.get(name), value)]


def verified(path: pathlib.Path, threads: int = 0) -> list[str]:
    """What of a file of --json differs from fresh runs of its controllers with its settings; empty: nothing.

    Raises ValueError for a file that is none, of another version, or with cases that are not of the set.
    """
    try:
        document = parse_json(path.read_text(encoding='utf-8'))
        version, stated = document['version'], (document['set'], document['bounds'])
        entries = [(Entry(str(one['name']), dict(one['settings']), bool(one.get('warm'))), [dict(row) for row in one['runs']],
                    [dict(score) for score in one['scores']]) for one in document['controllers']]
        keys = [[(str(row['case']), int(row['seed'])) for row in rows] for _, rows, _ in entries]
    except (OSError, KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(f'--verify "{path}": no result of the benchmark; give a file that --json has written') from None
    if version != cases.VERSION:
        raise ValueError(f'{path}: of version {version} of the benchmark, this is version {cases.VERSION}')
    known = bounds.stored()
    found = [f'the file\'s checksum of the {name} is {value}, this version has {own}' for name, value, own in
             zip(('set', 'bounds'), stated, (cases.checksum(), bounds.checksum(known))) if value != own]
    every = cases.whole_set()
    if document.get('whole'):
        complete = [(case.key, seed) for case in every for seed in cases.SEEDS]
        found += [f'{entry.label}: the file says that it is whole, and has not all runs of the set'
                  for (entry, _, _), own in zip(entries, keys) if own != complete]
    for (entry, rows, scores), own in zip(entries, keys):
        if not own:
            raise ValueError(f'{path}: {entry.label} has no runs')
        names, seeds = list(dict.fromkeys(key for key, _ in own)), list(dict.fromkeys(seed for _, seed in own))
        chosen = [case for case in every if case.key in names]
        if [(case.key, seed) for case in chosen for seed in seeds] != own:
            raise ValueError(f'{path}: {entry.label} has runs that are not of the set, or in another order; results of --draw '
                             'cannot be checked, so repeat them')
        fresh = run(entry, chosen, known, seeds, threads)
        for stored, row in zip(rows, fresh.rows):
            found += _differences(f'{entry.label}, {row["case"]}, seed {row["seed"]}', stored, row)
        groups = [score.group for score in fresh.scores]
        if [score.get('group') for score in scores] != groups:
            found.append(f'{entry.label}: the file has not one score each for the groups {", ".join(groups)}')
            continue
        for stored, score in zip(scores, fresh.scores):
            found += _differences(f'{entry.label}, group {score.group}', stored, score.as_row())
    return found
