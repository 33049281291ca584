"""The pictures of docs/paper.md: the map of the claim, and the counterparts of the paper's figures."""
from __future__ import annotations

import pathlib
import subprocess
import tempfile
from collections.abc import Sequence
from functools import partial

import numpy as np

from abs_hil.files import write_text, write_whole

from .laws import Entry
from .map import FIGURES, PAPER_RATIO, Map

#: the paper's figures, by the names of our files
DRAWN = ('5-upper-wheel', '6-lower-wheel', '7-slip', '8-torque', '9-theta', '10-distance')

#: figures that the paper's ratio is about
CONTOURED = ('stop_time_s', 'stop_distance_m')


def draw(maps: Sequence[Map], path: pathlib.Path) -> None:
    """The map: ratios over K and gamma, hatched where the baseline does not count, with the contour of the paper's 0.933. One
    row a map, one column a figure of merit. Writes SVG or PNG by the name of `path`."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot
    from matplotlib.colors import LogNorm, TwoSlopeNorm
    pyplot.rcParams.update({'svg.hashsalt': 'abs_hil', 'svg.fonttype': 'none'})
    near, far = TwoSlopeNorm(1.0, 0.7, 1.3), LogNorm(0.05, 20.0)
    norms = {name: near if name in CONTOURED else far for name in FIGURES}
    figure, rows = pyplot.subplots(len(maps), len(FIGURES), figsize=(3.2 * len(FIGURES), 2.7 * len(maps)), squeeze=False,
                                   sharex=True, sharey=True, layout='constrained')
    for row, one in zip(rows, maps):
        for axis, (name, title) in zip(row, FIGURES.items()):
            ratio, norm = one.ratio[name], norms[name]
            axis.pcolormesh(one.gain_m_s2, one.gamma, np.clip(ratio, norm.vmin, norm.vmax).T, cmap='RdBu_r',
                            shading='nearest', norm=norm, rasterized=True)
            axis.contourf(one.gain_m_s2, one.gamma, one.admissible.T.astype(float), levels=[-0.5, 0.5],
                          hatches=['////'], alpha=0.0)
            if np.nanmin(ratio) < PAPER_RATIO < np.nanmax(ratio) and name in CONTOURED:
                axis.contour(one.gain_m_s2, one.gamma, np.nan_to_num(ratio, nan=9.0).T, levels=[PAPER_RATIO],
                             colors='black', linewidths=1.2)
            for found, mark in ((one.best(), '*'), (one.median(), 'o')):
                if found is not None:
                    axis.plot(one.gain_m_s2[found[0]], one.gamma[found[1]], mark, color='black', markersize=8,
                              markerfacecolor='white')
            axis.set_xscale('log')
            axis.set_yscale('log')
            axis.minorticks_off()
            if one is maps[0]:
                axis.set_title(f'{title}: adaptive / sliding-mode', fontsize=9)
            if one is maps[-1]:
                axis.set_xlabel('K / (m/s²)')
        row[0].set_ylabel(f'{one.plant}, {one.actuator}\nγ / (kg² m/s³)', fontsize=9)
    for columns, label in ((rows[:, :2], 'time, distance'), (rows[:, 2:], 'variation, slip')):
        figure.colorbar(columns[0, 0].collections[0], ax=columns, shrink=0.6, location='bottom',
                        label=f'{label}: adaptive has less below 1')
    kind = path.suffix.removeprefix('.')
    write_whole(path, partial(figure.savefig, format=kind, metadata={'Date': None} if kind == 'svg' else None, dpi=110))
    pyplot.close(figure)


def draw_figures(program: pathlib.Path, laws: Sequence[Entry], plant: str, folder: pathlib.Path) -> None:
    """The counterparts of the paper's figures 5 to 10: whole experiments of the adaptive law and a baseline, by abs_report."""
    with tempfile.TemporaryDirectory() as scratch:
        data = pathlib.Path(scratch)
        for number, law in enumerate(laws):
            sets = [word for key, value in law.settings('real').items() if key.startswith('control.')
                    for word in ('--set', f'{key}={value!r}')]
            subprocess.run([program, '--backend', 'sim', '--fast', '--no-lcm', '--plant', plant, '--controller', law.controller,
                            *sets, '--out', data / str(number)], check=True, capture_output=True)
        subprocess.run([program.with_name('abs_report'), '--paper', data / '0', data / '1', '--out', data / 'page.html',
                        '--figures', data], check=True, capture_output=True)
        for name in DRAWN:
            drawn = (data / f'fig{name.partition("-")[0]}.svg').read_text(encoding='utf-8')
            write_text(folder / f'paper-{name}.svg', drawn)
