"""abs_python_host: a controller in Python, MODULE:CLASS, in a process of its own. abs_hil starts it (docs/interchange.md)."""
import importlib
import inspect
import os
import sys
import traceback
from typing import Any

from ..core import load_network
from ..options import failed


def made(name: str) -> Any:
    """A new object of the class MODULE:CLASS, of a module in this folder or on PYTHONPATH. Raises ValueError."""
    module, _, inner = name.partition(':')
    if '' not in sys.path:
        sys.path.append('')  # the folder in which the program was started, as of `python -m`
    fix = '; give MODULE:CLASS, of a module in this folder or on PYTHONPATH'
    try:
        law_class = getattr(importlib.import_module(module), inner)
        fix = '; the class is made without arguments'
        law = law_class()
    except (Exception, SystemExit) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        if isinstance(error, SyntaxError):
            fix = ''  # its text has file and line
        elif last.filename != __file__ and not last.filename.startswith('<frozen'):
            fix = f' ({last.filename}, line {last.lineno})'
        raise ValueError(f'controller {name}: {type(error).__name__}: {error}{fix}') from None
    if not (callable(getattr(law, 'reset', None)) and callable(getattr(law, 'step', None))):
        raise ValueError(f'controller {name}: it has no methods reset and step (docs/python.md)')
    return law


def _parts(name: str) -> tuple[Any, str]:
    law = made(name)
    return law, os.path.realpath(inspect.getfile(type(law)))


def main(arguments: list[str]) -> int:
    try:
        os.fstat(3)
    except OSError:
        return failed('abs_python_host', 'abs_hil starts this program by itself, for --controller MODULE:CLASS')
    sys.stdout = sys.stderr  # as run_host does, but whole lines come out at once: this process may end at any time
    return load_network('a controller in Python').serve_controller(_parts)
