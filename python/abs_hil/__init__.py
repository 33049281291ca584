"""The Inteco ABS laboratory rig in Python: simulate it, load its runs, step its plant and controllers, watch it live.

    import abs_hil
    run = abs_hil.simulate(controller="adaptive", set={"plant.theta_N": 30})
    run.data.plot(x="time_s", y=["slip", "slip_ref"])     # a pandas DataFrame with the columns of the program's CSV
    run.summary["stop_time_s"]

The laws, the plant and the cycle are the program's own C++ (abs_hil._core): nothing is written twice. Wrong input raises
ValueError with the program's text. The messages of a running experiment (`decode`, `TYPES`) need only Python.
"""
import importlib
from typing import TYPE_CHECKING, Any

from .messages import PHASES, QUANTITIES, REASONS, TYPES, decode, live, row_of

if TYPE_CHECKING:
    __version__: str
    from .identification import Identified, identify
    from .merits import FigureOfMerit, figures
    from .recording import load, load_series
    from .run import Run, Series
    from .simulation import Study, controllers, experiments, keys, plants, simulate, simulate_many, simulate_series
    from .stepped import Controller, Plant, PlantState, SlipInput, SlipOutput
    from .studies import StudyResults, load_study, simulate_run, study

# Importing the types' modules has put modules under these names.
globals().update(TYPES)

#: module -> the names that it gives; loaded at first use, so that decoding messages needs only Python
_LATER = {'merits': ('FigureOfMerit', 'figures'),
          'identification': ('Identified', 'identify'),
          'recording': ('load', 'load_series'),
          'run': ('Run', 'Series'),
          'stepped': ('Controller', 'Plant', 'PlantState', 'SlipInput', 'SlipOutput'),
          'studies': ('StudyResults', 'load_study', 'simulate_run', 'study'),
         'simulation': ('Study', 'controllers', 'experiments', 'keys', 'plants', 'simulate', 'simulate_many',
                        'simulate_series')}
_MODULE_OF = {name: module for module, names in _LATER.items() for name in names}

__all__ = ['PHASES', 'QUANTITIES', 'REASONS', 'TYPES', 'Controller', 'FigureOfMerit', 'Identified', 'Plant', 'PlantState', 'Run',
           'Series', 'SlipInput', 'SlipOutput', 'Study', 'StudyResults', 'controllers', 'decode', 'experiments', 'figures',
           'identify', 'keys', 'live', 'load', 'load_series', 'load_study', 'plants', 'row_of', 'simulate',
           'simulate_many', 'simulate_run', 'simulate_series', 'study']


if not TYPE_CHECKING:  # a checker of types must see a name that does not exist
    def __getattr__(name: str) -> Any:
        if name == '__version__':
            from .core import _core
            return _core.version
        if name not in _MODULE_OF:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        value = getattr(importlib.import_module(f'.{_MODULE_OF[name]}', __name__), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULE_OF, *TYPES})
