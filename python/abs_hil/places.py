"""Where the files of this package are that are no Python: tables, libraries for FMUs, the charts of its pages;
and what to say of a Python package that is not there."""
import pathlib
import sys
import sysconfig

#: of uPlot, which draws the charts of abs_serve and of the lab
CHARTS_SCRIPT, CHARTS_STYLE = 'uPlot.iife.min.js', 'uPlot.min.css'


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
    """The command, after "install it: ". Debian's own Python takes none from pip."""
    managed = sys.prefix == sys.base_prefix and pathlib.Path(sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED').exists()
    where = ' in an environment of your own (docs/troubleshooting.md, "Installing")' if managed else ''
    return f'pip install {package}{where}, or scripts/setup_python.sh in the source folder'
