"""abs_hil benchmark: how near to the shortest braking a controller comes, over a fixed set of cases (docs/benchmark.md)."""
import argparse
import math
import pathlib
import sys
from collections.abc import Mapping
from typing import Any

from .. import parsers
from ..core import _core
from ..files import parse_json, read_text, write_text, write_whole
from ..options import as_main, settings_of
from ..report.page import plotly_js
from ..simulation import controllers
from . import bounds, cases
from .page import as_json, html, table, text
from .score import Entry, keeps, run

#: differences that --verify prints
SHOWN = 20
#: what a figure may differ by, relative: another compiler may round differently
TOLERANCE = 1e-6


def _chosen(given: argparse.Namespace) -> tuple[list[cases.Case], dict[str, dict[str, float]]]:
    if given.draw is None:
        return (cases.quick_cases() if given.quick else cases.whole_set()), bounds.stored()
    drawn = cases.drawn(given.draw, given.count or cases.DRAWN)
    found = bounds.found(drawn, given.bounds)
    without = [case for case in drawn if not found[bounds.identity(case)]]
    for case in without:
        print(f'abs_hil benchmark: {case.key} is left out: no bound was found, the wheel locks there whatever the brake does '
              'or the solver failed', file=sys.stderr)
    return [case for case in drawn if case not in without], found


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
        document = parse_json(read_text(path))
        version, stated = document['version'], (document['set'], document['bounds'])
        given = [((str(one['name']), dict(one['settings']), bool(one.get('warm'))), [dict(row) for row in one['runs']],
                  [dict(score) for score in one['scores']]) for one in document['controllers']]
        keys = [[(str(row['case']), int(row['seed'])) for row in rows] for _, rows, _ in given]
        if not given:
            raise ValueError
    except (OSError, KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(f'--verify "{path}": no result of the benchmark; give a file that --json has written') from None
    entries = [(Entry(*one), rows, scores) for one, rows, scores in given]
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
            found += _differences(f'{entry.label}, group {score.group}', stored, vars(score))
    return found


@as_main(parsers.benchmark, RuntimeError)
def main(given: argparse.Namespace) -> int:
    idle = ({*vars(given)} - {'verify', 'threads'} if given.verify else () if given.draw is not None else ('bounds', 'count'))
    for name in sorted(idle):
        if getattr(given, name) != parsers.benchmark().get_default(name):
            raise ValueError(f'--{name} has no effect {"with --verify" if given.verify else "without --draw"}; leave it out')
    if given.verify is not None:
        found = verified(given.verify, given.threads)
        summary = f'{len(found)} differences from fresh runs' if found else f'{given.verify}: fresh runs give the same'
        print(*found[:SHOWN], summary, sep='\n')
        return int(bool(found))
    settings = settings_of(given.set, 'control.KEY=VALUE')
    for target in filter(None, (given.json, given.page)):
        write_whole(target, lambda name: None, probe=True)
    if given.page is not None and given.page.suffix == '.html':
        plotly_js()
    names = [name for text in given.controller for name in text.split(',')]
    entries = [Entry(name, settings) for name in names or controllers()]
    chosen, known = _chosen(given)
    if given.warm:
        entries = [one for entry in entries for one in
                   ([entry, Entry(entry.name, settings, True)] if keeps(entry, chosen[0]) else [entry])]
        if not any(entry.warm for entry in entries):
            raise ValueError('--warm: none of these controllers keeps anything of the last braking; leave it out, or add '
                             '--controller adaptive-optimal')
    whole = not given.quick and given.draw is None
    results = []
    for entry in entries:
        results.append(run(entry, chosen, known, cases.SEEDS[:1] if given.quick else cases.SEEDS, given.threads))
        if total := results[-1].total.failed:
            faults = sorted({row['fault'] or 'no stop' for row in results[-1].rows if math.isnan(row['excess'])})
            print(f'abs_hil benchmark: {entry.label}: {total} of {len(results[-1].rows)} runs failed: {", ".join(faults)}',
                  file=sys.stderr)
        if len(entries) > 1:
            print(f'abs_hil benchmark: {entry.label}: {len(results)} of {len(entries)} controllers done', file=sys.stderr)
    print(table(results), end='')
    if given.json is not None:
        write_text(given.json, as_json(results, whole, _core.version))
    if given.page is not None:
        write_text(given.page, html(results, whole) if given.page.suffix == '.html' else text(results, whole))
    return 0
