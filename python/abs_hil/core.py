"""Loads the compiled module abs_hil._core and tells it where the configuration files are."""
import contextlib
import importlib
import pathlib
import sys
import sysconfig
import warnings
from typing import Any

try:
    from . import _core as _core
except ImportError as error:  # a build without it, or for another Python
    raise ImportError(f'abs_hil: the compiled module is missing ({error}); build it for this Python '
                      f'({sys.version.split()[0]}): `pip install .` in the source folder') from error


def _config_dir() -> pathlib.Path | None:
    with contextlib.suppress(ImportError):
        from ._build_tree import CONFIG_DIR
        return pathlib.Path(CONFIG_DIR)
    prefixes = (sysconfig.get_path('data'), sys.prefix, '/usr', '/usr/local')
    return next((folder for prefix in prefixes if (folder := pathlib.Path(prefix, 'share', 'abs_hil', 'config')).is_dir()), None)


def load_network(purpose: str) -> Any:
    """The compiled module abs_hil._network. Raises OSError, which names the purpose, where it is missing."""
    try:
        return importlib.import_module('._network', __package__)
    except ImportError as error:
        raise OSError(f'{purpose} needs the module abs_hil._network, which this installation lacks ({error}): wheels have the '
                      'simulator only. On Linux, `pip install .` in the source folder builds it, and the Debian package '
                      'python3-abs-hil has it; Windows and macOS have no such module') from error


def _warn_if_old() -> None:
    try:
        from ._build_tree import CORE_LIBRARIES, PROGRAM
    except ImportError:
        return  # installed: the program and the module came together
    linked = pathlib.Path(_core.__file__).stat().st_mtime
    if any(library.exists() and library.stat().st_mtime > linked for library in map(pathlib.Path, CORE_LIBRARIES)):
        build = pathlib.Path(PROGRAM).parent.parent
        warnings.warn(f'abs_hil: the compiled module {_core.__file__} is older than the program {PROGRAM}: laws, keys and '
                      f'results can differ; build it too: `cmake --build {build} --target abs_hil_python`', stacklevel=2)


_warn_if_old()
if (_folder := _config_dir()) is not None:
    _core.set_config_dir(str(_folder))
