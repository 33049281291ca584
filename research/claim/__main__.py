"""research/paper_comparison.sh: searches the gains, draws the map, and writes or checks the pages."""
from __future__ import annotations

import argparse
import os
import pathlib
import sys
import time
from collections.abc import Iterator

import numpy as np

from abs_hil.files import write_text

from .criteria import ACTUATORS, PLANTS
from .experiments import beyond_table, expected_table, figures_table, theory_phrases
from .guard import differences, replaced
from .laws import LAWS, PAPER_GAINS, Entry
from .map import FIGURES, Map, axes, draw_maps, read_maps, write_maps
from .page import Page, csv_text, first_order
from .pictures import draw, draw_figures
from .search import find_gains
from .swing import phrases

#: what a fresh run may differ by: another compiler or processor moves single runs, not means
TOLERANCE = 0.02
#: cells of each map that --check computes again
CHECKED_CELLS = 4

PAGE, THEORY, BEYOND = 'docs/paper.md', 'docs/theory.md', 'docs/theory-beyond.md'
MAPS, GAINS, PICTURE = 'docs/figures/paper-map.csv', 'config/paper', 'docs/figures/paper-map.svg'


def say(text: str) -> None:
    print(f'{time.strftime("%H:%M:%S")} {text}', file=sys.stderr, flush=True)


class Comparison:
    """The tree's pages and files, or copies below another folder."""

    def __init__(self, root: pathlib.Path, out: pathlib.Path, program: pathlib.Path, quick: bool, threads: int) -> None:
        self.root, self.out, self.program, self.threads = root, out, program, threads
        self.size, self.cases, self.runs = (6, 10, 40) if quick else (24, 50, 400)
        self.generations: int | None = 2 if quick else None
        self.training: int | None = 4 if quick else None

    def search(self) -> None:
        for actuator in ACTUATORS:
            for controller in LAWS:
                found = find_gains(controller, actuator, self.out / GAINS, self.generations, self.training,
                                   threads=self.threads)
                say(f'{actuator} {controller}: cost {found.cost:.5f}')

    def draw(self) -> list[Map]:
        maps = [one for actuator in ACTUATORS
                for one in draw_maps(actuator, *axes(self.size), cases=self.cases, threads=self.threads)]
        path = self.out / MAPS
        path.parent.mkdir(parents=True, exist_ok=True)
        write_maps(maps, path)
        return read_maps(path)  # as --check reads them: rounded

    def pages(self, maps: list[Map]) -> Iterator[tuple[str, str]]:
        """The pages as they should be: path below the root, and text."""
        page = Page(self.out / GAINS, maps, self.runs, self.threads)
        figures = figures_table(Entry(PAPER_GAINS, 'adaptive'), {plant: baseline_of(maps, plant) for plant in PLANTS})
        yield PAGE, replaced(self._text(PAGE), page.sections(),
                             [*page.phrases(), *phrases(self.program)])
        yield from page.files()
        yield 'docs/reference/paper-figures.csv', csv_text(*figures)
        yield THEORY, replaced(self._text(THEORY), [('expected', expected_table())], theory_phrases())
        yield BEYOND, replaced(self._text(BEYOND), [('measured', beyond_table())])

    def _text(self, name: str) -> str:
        return (self.root / name).read_text(encoding='utf-8')

    def write(self, maps: list[Map]) -> None:
        for name, text in self.pages(maps):
            path = self.out / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text)
            say(f'wrote {path}')
        shown = baseline_of(maps, PLANTS[0])
        if shown is not None:
            draw_figures(self.program, [Entry(PAPER_GAINS, 'adaptive'), shown], PLANTS[0], (self.out / PICTURE).parent)

    def check(self) -> list[str]:
        """What of the pages and of the map's file differs from fresh runs."""
        maps = read_maps(self.out / MAPS)
        found = check_cells(maps, self.cases, self.threads)
        for name, text in self.pages(maps):
            known = self._text(name) if (self.root / name).exists() else ''
            found += [f'{name}:\n{line}' for line in differences(known, text, TOLERANCE)]
        return found


def baseline_of(maps: list[Map], plant: str) -> Entry | None:
    """The best baseline of the map behind the real actuator."""
    one = next(one for one in maps if (one.plant, one.actuator) == (plant, 'real'))
    cell = one.best()
    return None if cell is None else first_order(one, cell, 'best')


def check_cells(maps: list[Map], cases: int, threads: int) -> list[str]:
    """Some cells of each map, computed again: the baselines that the page uses, and others drawn at random."""
    found = []
    random = np.random.default_rng(1)
    for one in maps:
        cells = [cell for cell in (one.best(), one.median(), one.least_favourable()) if cell is not None]
        cells += [(int(i), int(j)) for i, j in random.integers(0, one.gain_m_s2.size, (CHECKED_CELLS - len(cells), 2))]
        for i, j in cells:
            fresh = draw_maps(one.actuator, one.gain_m_s2[i:i + 1], one.gamma[j:j + 1], cases, threads,
                              plants=[one.plant])[0]
            pairs = [(name, one.ratio[name][i, j], fresh.ratio[name][0, 0]) for name in FIGURES]
            pairs += [('slip_rms', one.slip_rms[i, j], fresh.slip_rms[0, 0]), ('share', one.share[i, j], fresh.share[0, 0])]
            found += [f'{MAPS}: {one.plant} {one.actuator} K {one.gain_m_s2[i]:g} gamma {one.gamma[j]:g}: {name} {old:.4g}, '
                      f'now {new:.4g}' for name, old, new in pairs
                      if not np.isclose(old, new, rtol=TOLERANCE, atol=1e-3, equal_nan=True)]
    return found


def main() -> int:
    made = argparse.ArgumentParser('paper_comparison.sh', allow_abbrev=False,
                                   description='Repeats the comparison of docs/paper.md')
    made.add_argument('--quick', action='store_true', help='small search, map and series, below runs/paper-quick')
    made.add_argument('--check', action='store_true', help='change nothing; status 1 if the pages differ from fresh runs')
    made.add_argument('--only-pages', action='store_true', help='keep the gains and the map, write the pages again')
    made.add_argument('--out', metavar='DIR', type=pathlib.Path, help='write there instead of into the tree')
    made.add_argument('--threads', metavar='N', type=int, default=0, help='number of threads, 0: one for each processor [0]')
    o = made.parse_args()
    root = pathlib.Path.cwd()
    program = pathlib.Path(os.environ.get('ABS_BIN', root / 'build/release/bin')) / 'abs_hil'
    out = o.out or (root / 'runs/paper-quick' if o.quick else root)
    comparison = Comparison(root, out, program, o.quick, o.threads)
    if o.check:
        found = comparison.check()
        for line in found:
            print(line)
        print(f'{len(found)} differences from fresh runs' if found else 'the pages print what fresh runs give')
        return int(bool(found))
    if o.only_pages:
        maps = read_maps(out / MAPS)
    else:
        comparison.search()
        say('gains found')
        maps = comparison.draw()
        say('map computed')
    draw(maps, out / PICTURE)
    comparison.write(maps)
    return 0


if __name__ == '__main__':
    sys.exit(main())
