"""Runs studies in C++ threads, and single runs of them with all their rows."""
import json
import os
import pathlib
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, Union

import numpy as np

from ..core import _core
from ..options import text_of
from ..run import Run
from ..simulation import progress_shown, run_of
from .results import StudyResults, load_study

StudyLike = Union[str, 'os.PathLike[str]', Mapping[str, Any]]


def study(study: StudyLike, out: str | os.PathLike[str] | None = None, *, threads: int = 0,
          progress: bool | Callable[[int, int], None] = False) -> StudyResults:
    """Runs a study as `abs_hil study` does, in C++ threads without Python's lock, and returns its results.

    study:    a TOML file, or what it would hold: {"controllers": ["adaptive", "pi"], "factors": {"plant.theta_N":
              {"from": 15, "to": 30}}, "design": {"kind": "sobol", "points": 256}}.
    out:      folder of the results, as --out: the next call with the same study and folder goes on where this one was
              interrupted. Without: a temporary folder, which is removed with the results' object.
    threads:  number of threads, without effect on the results; 0: one for each processor.
    progress: True for a progress bar on stderr, or a function that is called with (done, all).

    Raises ValueError, with the program's text, for a study that cannot be used; OSError or RuntimeError for a folder that
    cannot be written.
    """
    if not 0 <= threads <= 1024:
        raise ValueError(f'threads {threads}: give a number in [0, 1024]')
    with ExitStack() as scratch:
        folder = os.fspath(out) if out is not None else os.path.join(scratch.enter_context(tempfile.TemporaryDirectory()), 'study')
        with _file_of(study) as (file, name), progress_shown(progress) as report:
            _core.run_study(str(file), folder, name, threads, report)
        results = load_study(folder)
        weakref.finalize(results, scratch.pop_all().close)
    return results


def simulate_run(study: StudyLike, run: int) -> Run:
    """Simulates run number `run` of a study, the one of that number in its results, and returns it with all its rows. It
    goes on to the end of its experiment. Raises ValueError for a number that the study does not have.
    """
    if int(run) < 0:
        raise ValueError(f'run {run}: give a number of at least 0')
    with _file_of(study) as (file, _):
        return run_of(*_core.simulate_run(str(file), int(run)))


@contextmanager
def _file_of(study: StudyLike) -> Iterator[tuple[pathlib.Path, str]]:
    """The study as a file, and its name."""
    if not isinstance(study, Mapping):
        path = pathlib.Path(study)
        yield path, path.stem
        return
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / 'study.toml'
        path.write_text(toml_of(study), encoding='utf-8')
        yield path, 'study'


def toml_of(values: Mapping[str, Any]) -> str:
    """Nested values as TOML: one line for each key of the outermost table, deeper tables inline. A dotted key stays one."""
    return ''.join(f'{_key(key)} = {_value(value)}\n' for key, value in values.items())


def _key(key: Any) -> str:
    if not isinstance(key, str) or not key:
        raise ValueError(f'a study has texts as keys, not {key!r}')
    return '.'.join(part if part.replace('_', '').replace('-', '').isalnum() and part.isascii() else _value(part)
                    for part in key.split('.'))


def _value(value: Any) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Mapping):
        return '{ ' + ', '.join(f'{_key(key)} = {_value(inner)}' for key, inner in value.items()) + ' }'
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple, np.ndarray, range)):
        return '[' + ', '.join(_value(inner) for inner in value) + ']'
    if isinstance(value, (int, float)):
        return text_of(value)
    raise ValueError(f'a study takes numbers, flags, texts, lists and dictionaries, not {value!r}')
