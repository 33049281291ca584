"""abs_python_host: a controller in Python, MODULE:CLASS, in a process of its own. abs_hil starts it (docs/interchange.md)."""
import importlib
import inspect
import os
import sys
from collections.abc import Callable
from typing import Any

from ..core import _core, load_network


def class_of(name: str) -> Any:
    """The class MODULE:CLASS, of a module in this folder or on PYTHONPATH. Raises ValueError."""
    module, _, inner = name.partition(':')
    if '' not in sys.path:
        sys.path.append('')  # the folder in which the program was started, as of `python -m`
    try:
        return getattr(importlib.import_module(module), inner)
    except (ImportError, AttributeError) as error:
        raise ValueError(f'controller {name}: {error}; give MODULE:CLASS, of a module in this folder or on PYTHONPATH') from None


def made(name: str) -> Any:
    """A new object of the class. Raises ValueError."""
    try:
        law = class_of(name)()
    except TypeError as error:
        raise ValueError(f'controller {name}: {error}; the class is made without arguments') from None
    if not (callable(getattr(law, 'reset', None)) and callable(getattr(law, 'step', None))):
        raise ValueError(f'controller {name}: it has no methods reset and step (docs/python.md)')
    return law


def _parts(name: str) -> tuple[Callable[[Any], Any], Callable[[Any], Any], list[str], str]:
    law = made(name)

    def step(given: Any) -> Any:
        output = law.step(given)
        return output if isinstance(output, _core.SlipOutput) else _core.SlipOutput(float(output))
    return law.reset, step, list(getattr(law, 'signals', {})), os.path.realpath(inspect.getfile(type(law)))


def main(arguments: list[str]) -> int:
    try:
        os.fstat(3)
    except OSError:
        print('abs_python_host: abs_hil starts this program by itself, for --controller MODULE:CLASS', file=sys.stderr)
        return 2
    return load_network('a controller in Python').serve_controller(_parts)
