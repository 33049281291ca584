"""The figures of merit of a braking run: the program's own table (src/analysis/braking_figures.hpp)."""
from dataclasses import dataclass
from functools import cache

from .core import _core

#: the largest excess of slip over its reference; for formulas that use this figure
OVERSHOOT = 'slip_overshoot'
#: endings of names, and their units
_UNITS = {'_rad_s': 'rad/s', '_m_s': 'm/s', '_Nm': 'N m', '_N': 'N', '_m': 'm', '_s': 's', '': ''}


def with_unit(title: str, unit: str) -> str:
    """A heading: "distance / m", "torque variation / (N m)"."""
    return f'{title} / ({unit})' if ' ' in unit or '/' in unit else f'{title} / {unit}' if unit else title


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
        return with_unit(self.title, self.unit)


@cache
def figures() -> dict[str, FigureOfMerit]:
    """The figures by their names in summary and results, in the order of a study's results."""
    return {row['name']: FigureOfMerit(**row) for row in _core.figures()}


def heading_of(name: str) -> str:
    """A figure's heading; of a name that the table lacks, as of a study's own metric, its words and unit."""
    if name in figures():
        return figures()[name].heading
    ending = next(ending for ending in _UNITS if name.endswith(ending))
    return with_unit(name.removesuffix(ending).replace('_', ' '), _UNITS[ending])
