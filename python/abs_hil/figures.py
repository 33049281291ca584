"""The figures of merit of a braking run: the program's own table (src/analysis/braking_figures.hpp)."""
from dataclasses import dataclass
from functools import cache

from .core import _core

#: the largest excess of slip over its reference; for formulas that use this figure
OVERSHOOT = 'slip_overshoot'


#: endings of names, and how a heading writes them
_UNITS = {'_rad_s': '(rad/s)', '_m_s': '(m/s)', '_Nm': '(N m)', '_N': 'N', '_m': 'm', '_s': 's'}


@dataclass(frozen=True)
class FigureOfMerit:
    """One figure. better: 'less', 'nearer zero' or 'neither'; compared: `abs_hil compare` shows it."""
    name: str
    title: str
    unit: str
    decimals: int
    better: str
    compared: bool
    in_summary: bool
    meaning: str

    @property
    def heading(self) -> str:
        """Title and unit, for the head of a column: "torque variation / (N m)"."""
        unit = f'({self.unit})' if ' ' in self.unit else self.unit
        return f'{self.title} / {unit}' if unit else self.title


@cache
def figures() -> dict[str, FigureOfMerit]:
    """The figures by their names in summary and results, in the order of a study's results."""
    return {row['name']: FigureOfMerit(**row) for row in _core.figures()}


def heading_of(name: str) -> str:
    """A figure's heading; of a name that the table lacks, as of a study's own metric, its words and unit."""
    if name in figures():
        return figures()[name].heading
    ending = next((ending for ending in _UNITS if name.endswith(ending)), '')
    words = name.removesuffix(ending).replace('_', ' ')
    return f'{words} / {_UNITS[ending]}' if ending else words
