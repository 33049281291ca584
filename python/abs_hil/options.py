"""The arguments that abs_hil.simulate, Plant and Controller share, as the program's options."""
import argparse
import contextlib
import functools
import operator
import os
import pathlib
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

from .core import _core, load_network
from .files import refusal
from .places import misfit

#: a configuration value as Python has it
Value = Union[bool, int, float, str]
PathLike = Union[str, 'os.PathLike[str]']


def program() -> str:
    """The program abs_hil: of this build tree, beside this Python, or in the PATH. Raises ValueError without one."""
    try:
        from ._build_tree import PROGRAM
        return str(PROGRAM)
    except ImportError:
        beside = pathlib.Path(sys.executable).with_name('abs_hil')
        found = str(beside) if beside.exists() else shutil.which('abs_hil')
    if found is None:
        raise ValueError('controllers from files need the program abs_hil, which is not in the PATH; install it')
    return found


def failed(name: str, error: object, status: int = 2) -> int:
    """Says why a program ends; its exit status."""
    if isinstance(error, Exception) and (missing := misfit(error)):  # some packages are imported only where they are needed
        error, status = missing, 3
    if isinstance(error, OSError) and error.filename:
        error = f'{error.filename}: {refusal(error, deed="reach")}'
    with contextlib.suppress(BrokenPipeError):
        print(f'{name}: {error}', file=sys.stderr)
    return status


def as_main(parser: Callable[[], argparse.ArgumentParser], *others: type[Exception], os_error: int = 2,
            ) -> Callable[[Callable[[argparse.Namespace], int | None]], Callable[[Sequence[str] | None], int]]:
    """Makes the main(arguments) of a program of what it does with its options. That may raise ValueError and the others, which
    are status 2, and OSError, whose status is `os_error`; without a status of its own a program ends with 0."""
    told: tuple[type[Exception], ...] = (ValueError, OSError, *others)

    def decorated(work: Callable[[argparse.Namespace], int | None]) -> Callable[[Sequence[str] | None], int]:
        @functools.wraps(work)
        def main(arguments: Sequence[str] | None = None) -> int:
            made = parser()
            try:
                return work(made.parse_args(arguments)) or 0
            except told as error:
                return failed(made.prog, error, os_error if isinstance(error, OSError) else 2)
        return main
    return decorated


@functools.cache
def _take_controller_files() -> None:
    """Lets controllers come from files: their code runs in a process that lies beside the program."""
    for ending, maker in load_network('a controller from a file').controller_files(program()).items():
        _core.take_controller_files(ending, maker)


def text_of(value: Value, what: str = '') -> str:
    """The value as --set takes it: numbers in full, true and false. NumPy's scalars count as Python's. Raises ValueError, whose
    text begins with `what`, for any other."""
    value = getattr(value, 'item', lambda: value)()
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, (int, str)):
        return str(value)
    if isinstance(value, float):
        return repr(value)
    raise ValueError(f'{what}{value!r} is no configuration value; give a number, True, False or a text')


def settings_of(texts: Sequence[str], form: str = 'KEY=VALUE') -> dict[str, Value]:
    """The values by key of the words of --set. Raises ValueError for one that has not this form."""
    for text in texts:
        if '=' not in text:
            raise ValueError(f'--set "{text}": give {form}')
    return {key: value for key, _, value in (text.partition('=') for text in texts)}


def _assignments(values: Any) -> list[str]:
    if not isinstance(values, Mapping):
        raise ValueError(f'set {values!r}: give a dictionary of values by dotted key, as {{"plant.theta_N": 30}}')
    return [f'{key}={text_of(value, f"set: {key}: ")}' for key, value in values.items()]


def options(*, controller: Any = None, plant: PathLike | None = None, model: PathLike | None = None,
            experiment: PathLike | None = None, config: PathLike | None = None, seed: int | None = None,
            set: Mapping[str, Value] | None = None, inject: Sequence[str] = ()) -> dict[str, Any]:
    """Options for abs_hil._core; a controller that is not a name is left out."""
    files = {'plant': plant, 'model': model, 'experiment': experiment, 'config': config}
    given: dict[str, Any] = {name: os.fspath(value) for name, value in files.items() if value is not None}
    if isinstance(controller, str):
        if controller.endswith(('.so', '.fmu', '.agent')) or ':' in controller:
            _take_controller_files()
        given['controller'] = controller
    if seed is not None:
        try:
            given['seed'] = str(operator.index(seed))
        except TypeError:
            raise ValueError(f'seed {seed!r}: give an integer of at least 0') from None
    if set:
        given['set'] = _assignments(set)
    if inject:
        given['inject'] = [inject] if isinstance(inject, str) else list(inject)
    return given
