"""Where the files of this package are that are no Python: tables, libraries for FMUs, the charts of its pages;
and what to say of a Python package that is not there."""
import contextlib
import pathlib
import re
import sys
import sysconfig
import traceback
from typing import Any

#: of uPlot, which draws the charts of abs_serve and of the lab
CHARTS_SCRIPT, CHARTS_STYLE = 'uPlot.iife.min.js', 'uPlot.min.css'


class Unavailable(ImportError):
    """A part that this computer lacks; the message says how to install it. The programs end with status 3."""


def folders() -> list[str]:
    """The folders of the package: after `pip install -e` the sources' own, and the one with what CMake has made."""
    return list(sys.modules[__package__].__path__)


def place_of(name: str) -> pathlib.Path:
    """The file or folder of that name; where it should be if there is none."""
    places = [pathlib.Path(folder) / name for folder in folders()]
    return next((place for place in places if place.exists()), places[0])


def charts() -> pathlib.Path:
    """The folder of uPlot: installed in serve, in the source tree in third_party. Raises ImportError without it."""
    package = pathlib.Path(__file__).resolve().parent
    installed = package / 'serve' / 'uplot'
    found = installed if installed.is_dir() else package.parents[1] / 'third_party' / 'uplot'
    if not (found / CHARTS_SCRIPT).exists():
        raise ImportError(f'"{found}" lacks {CHARTS_SCRIPT}, which draws the charts')
    return found


def how_to_install(package: str) -> str:
    """The command that installs a Python package, or with the name of none makes those of this tree fit each other. In a source
    tree it is the script whose list names the package. Debian's own Python takes none from pip."""
    with contextlib.suppress(ImportError):
        from ._build_tree import CONFIG_DIR
        scripts = pathlib.Path(CONFIG_DIR).parent / 'scripts'
        name = re.escape(re.split('[<>=]', package.strip('\'"'))[0])
        for path in scripts.glob('*packages*.txt') if name else ():
            if re.search(rf'^(python3-)?{name}(?![\w-])', path.read_text(encoding='utf-8'), re.MULTILINE | re.IGNORECASE):
                return f'{scripts}/{"setup_python.sh" if path.name.startswith("python") else "setup.sh"} {path.name}'
        return f'{scripts}/setup_python.sh python-packages.txt'
    managed = sys.prefix == sys.base_prefix and pathlib.Path(sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED').exists()
    where = ' in an environment of your own (docs/troubleshooting.md, "Installing")' if managed else ''
    return (f'apt-get install python3-{package}, or ' if managed and package else '') + \
        f'pip install {package or "--force-reinstall numpy pandas scipy matplotlib"}{where}'


def misfit(error: BaseException) -> str | None:
    """If the error came while a package of others was imported: what is missing or does not fit, and the command that mends it,
    in one line. A package for another version of NumPy raises more than ImportError."""
    name = (error.name or '').partition('.')[0] if isinstance(error, ImportError) else ''
    frames = [step.f_code for step, _ in traceback.walk_tb(error.__traceback__)]
    importing = ''.join(f'{code.co_filename}\n' for code in frames if code.co_name == '<module>')
    found = re.findall(r'[/\\](?:site|dist)-packages[/\\](\w+)', importing)
    outer = next((one for one in found if one != __package__), '')
    if isinstance(error, ModuleNotFoundError) and name and not outer:
        return f'the Python package {name} is missing; install it: {how_to_install(name)}'
    if not outer and name in ('', __package__, *sys.stdlib_module_names):
        return None
    np: Any = sys.modules.get('numpy')
    beside = f'NumPy {np.__version__} of {pathlib.Path(np.__file__).parents[1]}' if hasattr(np, '__version__') else 'the others'
    return (f'the Python package {outer or name} does not fit {beside} ({type(error).__name__}: '
            f'{" ".join(str(error).split())[:200]}); mend it: {how_to_install("")}')
