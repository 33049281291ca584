"""The files of runs, except their rows: what the command line names, and the files beside each CSV."""
import json
import math
import os
import pathlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core import _core
from ..files import parse_toml
from ..recording import CSV, NO_CSV, kind_of, load, named, read_events, run_names, runs_in_series
from ..run import Event, Run, flattened, names_apart, read_object, read_text
from .text import DASH, clean, number_text

NAME_CHARACTERS = 40
MOST_DIFFERENCES = 3
#: largest accepted bin of a histogram, 10 s
MOST_US = 10_000_000
PARTS = ('wake-up latency', 'read', 'control', 'write', 'whole cycle')


@dataclass
class Histogram:
    """Numbers of cycles by the duration of their parts: counts[part][us]."""
    counts: np.ndarray
    overflows: list[int]


@dataclass
class RunFiles:
    """All files of a run but its rows. All but the CSV may be missing; `notes` say what is missing."""
    source: str | os.PathLike[str]  # of its rows: a file, or FILE#N
    name: str
    label: str = ''    # in legends and table heads: the given one, else in what it differs from the others
    called: str = ''   # in notes and files: the given label, else the name
    summary: dict[str, Any] = field(default_factory=dict)
    config: dict[str, str] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    histogram: Histogram | None = None
    notes: list[str] = field(default_factory=list)

    def number(self, dotted: str) -> float:
        """A number from the summary; NaN if it has none."""
        at: Any = self.summary
        for key in dotted.split('.'):
            at = at.get(key) if isinstance(at, dict) else None
        return float(at) if isinstance(at, (int, float)) and not isinstance(at, bool) else math.nan

    def text(self, key: str) -> str:
        value = self.summary.get(key)
        return clean(value) if isinstance(value, str) else ''

    def rows(self) -> Run:
        """Read anew each time: the rows of many runs do not fill the memory."""
        return load(self.source)


@dataclass
class FoundRuns:
    """series: the name of each, and its runs as indices into `runs`."""
    runs: list[RunFiles] = field(default_factory=list)
    series: list[tuple[str, list[int]]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def texts_of(values: dict[str, Any]) -> dict[str, str]:
    """Nested values as text under dotted keys."""
    return {clean(key, 120): number_text(value) if not isinstance(value, (list, type(None))) else clean(json.dumps(value))
            for key, value in flattened(values).items()}


def read_toml(path: pathlib.Path) -> dict[str, str]:
    text = read_text(path)
    try:
        return texts_of(parse_toml(text))
    except ValueError as error:
        line = re.search(r'at line (\d+)', str(error))
        raise ValueError(f'{path}{":" + line[1] if line else ""}: {clean(error)}') from None


def read_histogram(path: pathlib.Path) -> Histogram:
    bins: list[list[float]] = []
    overflows = [0] * len(PARTS)
    title = '# Histogram Overflows:'
    for number, line in enumerate(read_text(path).splitlines(), 1):
        if number == 1 and not line.startswith('# abs_hil, us;'):
            raise ValueError(f'{path}:1: not a histogram of abs_hil: the file must begin with "# abs_hil, us;"')
        overflow = line.startswith(title)
        if not line or (line[0] == '#' and not overflow):
            continue
        try:
            fields = [int(text) for text in (line[len(title):] if overflow else line).split()]
            counts = fields[-len(PARTS):] if overflow else fields[1:1 + len(PARTS)]
            if len(counts) < len(PARTS) or min(fields) < 0 or (not overflow and fields[0] > MOST_US):
                raise ValueError
        except ValueError:
            raise ValueError(f'{path}:{number}: not a line of a histogram: "{clean(line, 60)}"') from None
        if overflow:
            overflows = counts
        else:
            bins.append(list(map(float, fields[:1] + counts)))
    us, *parts = np.reshape(bins, (-1, 1 + len(PARTS))).T
    return Histogram(np.array([np.bincount(us.astype(int), part) for part in parts]), overflows)


def _read_folder(run: RunFiles, folder: pathlib.Path) -> None:
    def there(name: str, what: str, read: Callable[[pathlib.Path], Any]) -> Any:
        """What an optional file holds, or None. A broken one becomes a note, so that the run is still shown."""
        if not (folder / name).exists():
            run.notes.append(f'no {name}: {what}')
            return None
        try:
            return read(folder / name)
        except ValueError as error:
            run.notes.append(f'not used: {clean(error, 400)}')
            return None

    run.summary = there('summary.json', 'metrics are computed from the CSV; names and result are unknown', read_object) or {}
    if isinstance(run.summary.get('config'), dict):
        run.config = texts_of(run.summary['config'])
    else:
        run.config = there('config.toml', 'the configuration is unknown', read_toml) or {}
    run.environment = texts_of(there('environment.json', 'kernel, build and board are unknown', read_object) or {})
    run.events = there('events.csv', 'events are the phase changes in the CSV, without reasons',
                       lambda path: read_events(path.read_bytes(), path)) or []
    if run.summary.get('virtual_time') is not True:
        run.histogram = there('histogram.txt', "no histograms of the cycle's timing", read_histogram)


def _base_name(path: pathlib.Path) -> str:
    whole = path.absolute()
    whole = whole.resolve() if whole.name in ('', '.', '..') else whole
    return clean(whole.name if path.is_dir() else whole.stem, NAME_CHARACTERS)


def _load_run(path: pathlib.Path) -> RunFiles:
    if path.is_dir():
        _core.check_seal(os.fsencode(path))
        run = RunFiles(path / ('run.csv' if (path / 'run.csv').exists() else 'run.lcmlog'), _base_name(path))
        _read_folder(run, path)
        if not (path / 'run.csv').exists():
            run.notes.append(NO_CSV)
        return run
    if kind_of(named(path)[0]) == CSV:
        return RunFiles(path, _base_name(path), notes=[
            'only a CSV file: configuration, reasons and timing are unknown; metrics are computed from it with the paper\'s '
            'radius and end speed'])
    read = load(path)
    return RunFiles(path, clean(read.name, NAME_CHARACTERS), summary=read.summary, config=texts_of(read.config),
                    events=read.events, notes=[*read.notes, *read.losses])


def find_runs(arguments: Iterable[str | pathlib.Path], labels: Sequence[str] = ()) -> FoundRuns:
    """The runs that the command line names: files, of several runs in one all; run folders; series folders. Raises ValueError."""
    found = FoundRuns()
    for argument in arguments:
        path = pathlib.Path(argument)
        if not path.is_dir():
            found.runs += [_load_run(pathlib.Path(name)) for name in run_names(path)]
        elif (path / 'run.csv').exists() or (path / 'run.lcmlog').exists():
            found.runs.append(_load_run(path))
        elif (path / 'series.json').exists() or any(path.glob('run-*/')):
            folders, notes = runs_in_series(path)
            found.notes += [clean(note) for note in notes]
            found.series.append((_base_name(path), [*range(len(found.runs), len(found.runs) + len(folders))]))
            found.runs += [_load_run(folder) for folder in folders]
        else:
            raise ValueError(f'"{path}" is neither a run folder (no run.csv) nor a series folder (no series.json, no '
                             'run-0001/)')
    for run, name in zip(found.runs, names_apart(run.name for run in found.runs)):
        run.name = name
    _label(found.runs, labels)
    return found


def _label(runs: list[RunFiles], labels: Sequence[str]) -> None:
    if labels and len(labels) != len(runs):
        raise ValueError(f'{len(labels)} labels for {len(runs)} runs; give one --label for each run')
    differences = _what_differs(runs)
    for run, differs in zip(runs, differences):
        unique = differs and differences.count(differs) == 1
        run.called = run.name
        run.label = differs if unique else ', '.join(filter(None, [differs, run.name]))
    for run, label in zip(runs, labels):
        run.label = run.called = clean(label, 2 * NAME_CHARACTERS)


def _what_differs(runs: list[RunFiles]) -> list[str]:
    """In what each run differs from the others, as "pi, gamma=60"; of one run its controller."""
    named = [key for key in ('controller', 'plant', 'experiment', 'backend')
             if (len(runs) == 1 and key == 'controller') or len({run.text(key) for run in runs}) > 1]
    keys = []
    for key in differing_keys(runs):
        room, _, name = key.rpartition('.')
        # What a name says, and what a model has from its plant, is not said again.
        if room in named or (room == 'model' and all(run.config.get(key) == run.config.get(f'plant.{name}') for run in runs)):
            continue
        if key not in ('control.controller', 'run.seed') and not key.startswith('experiment_'):  # script, files
            keys.append(key)
    if not named and not keys:
        keys = [key for key in ('run.seed',) if key in differing_keys(runs)]
    sections = {_core.section_of(run.text('controller')) for run in runs}
    found = []
    for run in runs:
        parts = [run.text(key) or DASH for key in named]
        others = tuple(sections - {_core.section_of(run.text('controller'))})  # gains of other controllers say nothing
        parts += [f'{key.rpartition(".")[2]}={run.config.get(key, DASH)}' for key in keys if not key.startswith(others)]
        more = ['…'] if len(parts) > MOST_DIFFERENCES else []
        found.append(clean(', '.join(parts[:MOST_DIFFERENCES] + more), 2 * NAME_CHARACTERS))
    return found


def differing_keys(runs: list[RunFiles]) -> list[str]:
    """Configuration keys whose values differ between the runs that have a configuration."""
    configured = [run.config for run in runs if run.config]
    keys = sorted({key for config in configured for key in config})
    return [key for key in keys if len({config.get(key) for config in configured}) > 1]
