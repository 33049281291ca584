"""abs_python_host: a controller in Python, MODULE:CLASS, in a process of its own. abs_hil starts it (docs/interchange.md)."""
import importlib.machinery
import importlib.util
import inspect
import os
import sys
import traceback
from typing import Any

from ..core import load_network
from ..options import failed


def _imported(name: str) -> Any:
    """The module, from this folder even if Python or a package has one of that name, else from PYTHONPATH."""
    if '' not in sys.path:
        sys.path.append('')  # the folder in which the program was started, as of `python -m`
    top = name.partition('.')[0]
    here, known = importlib.machinery.PathFinder.find_spec(top, [os.getcwd()]), importlib.util.find_spec(top)
    if here is None or here.origin is None or known is not None and known.origin == here.origin:
        return importlib.import_module(name)
    alias = f'{top}_of_this_folder'  # who imports the other one must still get that
    if alias not in sys.modules:
        own = importlib.util.spec_from_file_location(alias, here.origin,
                                                     submodule_search_locations=here.submodule_search_locations)
        assert own is not None and own.loader is not None
        module = importlib.util.module_from_spec(own)
        own.loader.exec_module(module)
        sys.modules[alias] = module
    return importlib.import_module(alias + name.removeprefix(top))


def made(name: str) -> Any:
    """A new object of the class MODULE:CLASS, of a module in this folder or on PYTHONPATH. Raises ValueError."""
    module_name, _, inner = name.partition(':')
    fix = '; give MODULE:CLASS, of a module in this folder or on PYTHONPATH'
    try:
        module = _imported(module_name)
        fix = f' (in {getattr(module, "__file__", "Python itself")}){fix}'
        law_class = getattr(module, inner)
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
