"""Runs of the simulated rig in virtual time: one with all its rows, or many with their figures of merit."""
import contextlib
import itertools
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .core import _core
from .options import PathLike, Value, options
from .run import Run, Series, name_phases

if TYPE_CHECKING:
    import pandas

#: what `abs_hil compare` varies by default
STANDARD_VARIATION = 'parameters=0.1,theta=0.1,phase'
#: what `abs_hil compare` takes
REPEAT_MAX, SEED_MAX = 1_000_000, 2**64 - 1
_ARGUMENTS = {'controller', 'plant', 'model', 'experiment', 'config', 'seed', 'set', 'inject'}


def simulate(controller: Any = 'adaptive', plant: PathLike = 'paper-table1', experiment: PathLike = 'paper',
             seed: int = 1, set: Mapping[str, Value] | None = None, *, model: PathLike | None = None,
             config: PathLike | None = None, inject: Sequence[str] = (), repetition: int | None = None,
             vary: str = STANDARD_VARIATION, vary_seed: int = 1) -> Run:
    """Runs an experiment on the simulated rig in virtual time, as `abs_hil --fast` with the same options does.

    controller: a name (abs_hil.controllers()), FILE.so or FILE.fmu (docs/interchange.md), or an object with
                `reset(input)` and `step(input)` (abs_hil.SlipInput). `step` returns the wanted brake torque in N m, or an
                abs_hil.SlipOutput. An attribute `signals`, a dictionary name -> meaning of at most 8 signals, adds
                columns. The object runs through the same cycle as any law, the command gate included. An exception in it
                ends the run safely and is raised here.
    plant, model, experiment: names or TOML files. config: a TOML file with any configuration values.
    seed:       seed of everything random in the simulator, an integer >= 0.
    set:        configuration values by dotted key, as --set: {"control.slip_ref": 0.1, "plant.theta_N": 30}.
    inject:     faults as --inject takes them: ["brake@encoder_upper:stuck+0.2s"].
    repetition: number of a varied plant, from 0: the run that `simulate_many` with `vary` and `vary_seed` makes of it,
                but whole and with everything recorded. None: the plant itself.

    Returns a Run. Its columns equal those of the program's CSV bit for bit, each of shape (cycles,). A run that a fault
    ends is no error: Run.summary["result"] is "fault". Raises ValueError, with the program's text, for options that
    cannot be used.
    """
    given = _given(controller, plant, seed, experiment=None if experiment == 'paper' else experiment, model=model, config=config,
                   set=set, inject=inject)
    law = _law_of(controller)
    varied = None if repetition is None else (vary, _within('vary_seed', vary_seed, 0, SEED_MAX),
                                              _within('repetition', repetition, 0, REPEAT_MAX - 1))
    return run_of(*_core.simulate(given, law, varied))


def _given(controller: Any, plant: PathLike, seed: int, **others: Any) -> dict[str, Any]:
    """Options. A default must not outrank a configuration file, so it is left out: the program has the same defaults."""
    return options(controller=None if controller == 'adaptive' else controller, plant=None if plant == 'paper-table1' else plant,
                   seed=None if seed == 1 else seed, **others)


def _within(name: str, number: int, least: int, most: int) -> int:
    if not least <= number <= most:
        raise ValueError(f'{name} {number}: give a whole number in [{least}, {most}]')
    return number


def _law_of(controller: Any) -> Any:
    """The controller's object; None for a name. Raises ValueError for an object that is no controller."""
    if controller is None or isinstance(controller, str):
        return None
    if isinstance(controller, type):
        raise ValueError(f'controller: {controller.__name__} is a class; give an object of it, {controller.__name__}()')
    if callable(getattr(controller, 'reset', None)) and callable(getattr(controller, 'step', None)):
        return controller
    raise ValueError(f'controller: {type(controller).__name__} has no methods reset and step; give a controller\'s name or an '
                     'object with both')


def run_of(columns: dict[str, Any], signals: Sequence[str], summary: str, config_toml: str) -> Run:
    """The Run of what the core returns for a simulation."""
    name_phases(columns)
    return Run(columns, json.loads(summary), tuple(signals), config_toml=config_toml)


def simulate_series(experiment: PathLike = 'series-of-ten', controller: str = 'adaptive', plant: PathLike = 'paper-table1',
                    seed: int = 1, set: Mapping[str, Value] | None = None, *, model: PathLike | None = None,
                    config: PathLike | None = None) -> Series:
    """Runs all runs of a series (docs/experiments.md) on the simulated rig in virtual time, one after the other.

    experiment: a name or TOML file with [series] or [factors]; one without is a series of one run. The other arguments are
    those of `simulate`; `seed` is that of the first repetition if the file gives none.

    Returns a Series: its runs equal those of `abs_hil --fast` in their folders, and its index has what series.json has of
    them. Raises ValueError before the first run for options that cannot be used.
    """
    given = _given(controller, plant, seed, experiment=experiment, model=model, config=config, set=set)
    runs, rows = [], []
    for number, (varied, its_seed, parts) in enumerate(_core.simulate_series(given), 1):
        runs.append(run_of(*parts))
        runs[-1].name = f'run-{number:04}'
        rows.append({'folder': runs[-1].name, 'varied': json.loads(varied), 'seed': its_seed,
                     'status': runs[-1].summary['result']})
    return Series(runs, {'experiment': str(experiment), 'runs': rows}, [])


class Study:
    """Figures of merit of many runs: `Study[name]` is an array of shape (runs,).

    The figures are those of a run's summary (stop_time_s, slip_rms, ...), NaN where a run has none. `fault` is the reason
    of an early end, empty if there was none; `error` says why a run could not begin (only with keep_going). The arguments
    that differ between the runs are columns too, a configuration value under its dotted key.
    """

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        self.columns = dict(columns)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns['fault'])

    @property
    def data(self) -> 'pandas.DataFrame':
        """The columns as a pandas DataFrame, one row a run."""
        import pandas
        return pandas.DataFrame(self.columns)

    def __repr__(self) -> str:
        return f'<abs_hil.Study of {len(self)} runs>'


def simulate_many(runs: Iterable[Mapping[str, Any]] | Mapping[str, Sequence[Any]], *, vary: str | None = None,
                  repeat: int = 1, vary_seed: int = 1, threads: int = 0, progress: bool | Callable[[int, int], None] = False,
                  keep_going: bool = False) -> Study:
    """Simulates many runs in C++ threads, without Python's lock, and returns their figures of merit.

    runs:      a list of arguments of `simulate`, as in [{"controller": "pi"}, {"set": {"plant.theta_N": 30}}]; or a grid:
               {"controller": ["adaptive", "pi"], "plant.theta_N": [20, 23, 26]} means all combinations, in which a key
               with a dot is a configuration value. A controller in Python runs in the calling thread, one run after the
               other: its `reset` begins each braking. Faults are not injected here; `simulate` does.
    vary, repeat, vary_seed: each run is repeated on `repeat` varied plants, those of `abs_hil compare --vary --repeat
               --seed`, in that order: all runs meet the same plants. By default nothing varies.
    threads:   number of threads, without effect on the results; 0: one for each processor.
    progress:  True for a progress bar on stderr, or a function that is called with (done, all).
    keep_going: a run whose options cannot be used gets the reason in the column `error` instead of raising ValueError.

    A run ends as soon as its figures are known; the hold to standstill is left out. It begins as that of `simulate`, from
    standstill. `study`, `tune` and `abs_hil compare` begin with the wheels at 170 rad/s, which takes a tenth of the time:
    {"experiment.start_speed_rad_s": 170} does so here.
    """
    jobs = _grid(runs) if isinstance(runs, Mapping) else [dict(run) for run in runs]
    _within('repeat', repeat, 1, REPEAT_MAX)
    _within('vary_seed', vary_seed, 0, SEED_MAX)
    _within('threads', threads, 0, 1024)
    given, laws = [], []
    for run in jobs:
        if unknown := run.keys() - _ARGUMENTS:
            raise ValueError(f'{sorted(unknown)[0]!r} is no argument of a run; give some of {", ".join(sorted(_ARGUMENTS))}, and '
                             'configuration values in "set", or by dotted key in a grid')
        if run.get('inject'):
            raise ValueError(f'inject {run["inject"]!r}: many runs are simulated without faults; use simulate for this one')
        laws.append(_law_of(run.get('controller')))
        given.append(options(**run))
    drawn = vary is not None or repeat > 1
    pairs = [(number, index if drawn else None) for number in range(len(jobs)) for index in range(repeat)]
    if vary is None:
        vary = STANDARD_VARIATION if repeat > 1 else 'none'
    with progress_shown(progress) as report:
        found = _core.simulate_many(given, pairs, vary, vary_seed, threads, report, laws)
    errors = found.pop('error')
    for (number, _), error in zip(pairs, errors):
        if error and not keep_going:
            raise ValueError(f'run {number}: {error}' if len(jobs) > 1 else error)
    columns: dict[str, np.ndarray] = {}
    flat = [{**run, **run.get('set', {}), **({} if law is None else {'controller': type(law).__name__})}
            for run, law in zip(jobs, laws)]
    for name in sorted({name for run in flat for name in run if name != 'set'}):
        values = [run.get(name) for run in flat]
        if len(jobs) == 1 or any(value != values[0] for value in values):
            columns[name] = np.repeat(np.array(values), repeat)
    if repeat > 1:
        columns['repetition'] = np.tile(np.arange(repeat), len(jobs))
    columns.update(found, fault=np.array(found['fault'], dtype=object))
    if keep_going:
        columns['error'] = np.array(errors, dtype=object)
    return Study(columns)


def _grid(axes: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    for name, values in axes.items():
        if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
            raise ValueError(f'grid: {name}: give a list of values, not {values!r}')
    jobs = []
    for combination in itertools.product(*axes.values()):
        job: dict[str, Any] = {'set': {}}
        for name, value in zip(axes, combination):
            (job['set'] if '.' in name else job)[name] = value
        jobs.append(job)
    return jobs


@contextlib.contextmanager
def progress_shown(wanted: bool | Callable[[int, int], None]) -> Iterator[Callable[[int, int], None] | None]:
    """What to call with (done, all): the user's function, one that shows a bar on stderr, or None."""
    if callable(wanted) or not wanted:
        yield wanted if callable(wanted) else None
        return
    import tqdm
    with tqdm.tqdm(unit=' runs', file=sys.stderr, leave=False, delay=0.2) as bar:
        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)
        yield show


#: functions without arguments: name -> description of every controller, plant and experiment of the program
controllers, plants, experiments = _core.controllers, _core.plants, _core.experiments


def keys(**arguments: Any) -> dict[str, dict[str, Any]]:
    """Every configuration key: dotted name -> its unit, meaning, and the value that these arguments of `simulate` give."""
    return {row.pop('name'): row for row in _core.keys(options(**arguments))}
