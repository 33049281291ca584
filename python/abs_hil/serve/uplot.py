"""Where uPlot stands, which draws the charts of abs_serve and of the lab."""
import pathlib

_FOLDER = pathlib.Path(__file__).resolve().parent
SCRIPT, STYLE = 'uPlot.iife.min.js', 'uPlot.min.css'


def uplot() -> pathlib.Path:
    """Its folder: installed beside this file, in the source tree in third_party. Raises ImportError without it."""
    installed = _FOLDER / 'uplot'
    found = installed if installed.is_dir() else _FOLDER.parents[2] / 'third_party' / 'uplot'
    if not (found / SCRIPT).exists():
        raise ImportError(f'"{found}" lacks {SCRIPT}, which draws the charts')
    return found
