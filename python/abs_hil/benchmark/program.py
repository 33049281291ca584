"""abs_hil benchmark: how near to the shortest braking a controller comes, over a fixed set of cases (docs/benchmark.md)."""
from __future__ import annotations

import argparse
import pathlib
import sys
from collections.abc import Sequence

from ..core import _core
from ..files import write_text, write_whole
from ..options import Value, whole
from ..report.page import Unavailable, plotly_js
from ..simulation import controllers
from . import bounds, cases
from .html import html
from .page import as_json, table, text
from .score import Entry, keeps, run
from .verify import verified

#: differences that --verify prints
SHOWN = 20


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='abs_hil benchmark', allow_abbrev=False, description=__doc__.split(' (docs')[0] + '.')
    parser.add_argument('--controller', '--controllers', metavar='C,...', action='append', default=[],
                        help='names, FILE.so, FILE.fmu, or MODULE:CLASS of controllers in Python; may be repeated '
                             '(all controllers of the program)')
    parser.add_argument('--set', metavar='KEY=VALUE', action='append', default=[],
                        help='a value under control. for every controller; may be repeated')
    parser.add_argument('--quick', action='store_true', help='12 cases with one seed: a check, no score')
    parser.add_argument('--warm', action='store_true',
                        help='scores laws that keep something of the last braking also after one braking of each case')
    parser.add_argument('--draw', metavar='SEED', type=whole(0, 2**63 - 1), help='only cases that this seed draws; needs casadi')
    parser.add_argument('--count', metavar='N', type=whole(1, 10_000), help=f'how many of them ({cases.DRAWN})')
    parser.add_argument('--bounds', metavar='FILE', type=pathlib.Path,
                        help='keeps the bounds of drawn cases, so that they need not be computed again')
    parser.add_argument('--verify', metavar='FILE', type=pathlib.Path,
                        help='makes the runs of a file of --json again; status 1 if anything differs')
    parser.add_argument('--threads', metavar='N', type=whole(0, 1024), default=0, help='0: one for each processor')
    parser.add_argument('--json', metavar='FILE', type=pathlib.Path, help='all scores and runs')
    parser.add_argument('--page', metavar='FILE', type=pathlib.Path,
                        help='the page with the groups of cases: HTML with figures for FILE.html, otherwise Markdown')
    return parser


def _settings(texts: Sequence[str]) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for given in texts:
        key, equals, value = given.partition('=')
        if not equals or not key.startswith('control.'):
            raise ValueError(f'--set "{given}": give control.KEY=VALUE; plants and experiment are the benchmark\'s own')
        values[key] = value
    return values


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


def _verify(path: pathlib.Path, threads: int) -> int:
    found = verified(path, threads)
    for line in found[:SHOWN]:
        print(line)
    print(f'{len(found)} differences from fresh runs' if found else f'{path}: fresh runs give the same')
    return int(bool(found))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = _parser()
    given = parser.parse_args(arguments)
    idle = ({*vars(given)} - {'verify', 'threads'} if given.verify else () if given.draw is not None else ('bounds', 'count'))
    try:
        for name in sorted(idle):
            if getattr(given, name) != parser.get_default(name):
                raise ValueError(f'--{name} has no effect {"with --verify" if given.verify else "without --draw"}; leave it out')
        if given.verify is not None:
            return _verify(given.verify, given.threads)
        settings = _settings(given.set)
        for target in (given.json, given.page):
            if target is not None:
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
            if len(entries) > 1:
                print(f'abs_hil benchmark: {entry.label}: {len(results)} of {len(entries)} controllers done', file=sys.stderr)
    except (ValueError, RuntimeError, OSError) as error:
        print(f'abs_hil benchmark: {error}', file=sys.stderr)
        return 2
    print(table(results), end='')
    try:
        page = None if given.page is None else html(results, whole) if given.page.suffix == '.html' else text(results, whole)
    except Unavailable as error:
        print(f'abs_hil benchmark: {error}', file=sys.stderr)
        return 2
    for target, content in ((given.json, as_json(results, whole, _core.version)), (given.page, page)):
        if target is not None and content is not None:
            write_text(target, content)
    return 0


if __name__ == '__main__':
    sys.exit(main())
