"""abs_hil lab: a page that simulates the rig and its controllers in the browser, without a server (docs/lab.md).

One HTML file: the simulation core as WebAssembly, uPlot, and the page's own scripts.
"""
import json
import pathlib
from collections.abc import Sequence
from typing import Any

from .. import parsers
from ..core import _core
from ..files import write_text
from ..options import failed
from ..places import CHARTS_SCRIPT, CHARTS_STYLE, Unavailable, charts
from ..report.page import standalone
from .exercise import find, read

_FOLDER = pathlib.Path(__file__).resolve().parent
#: in this order one script
_SCRIPTS = ('engine.js', 'settings.js', 'controls.js', 'figures.js', 'lab.js')


def module() -> bytes:
    """The simulation core as WebAssembly: installed beside this file, in the source tree where scripts/lab.sh makes it."""
    places = [_FOLDER / 'abs_hil_lab.wasm']
    if len(_FOLDER.parents) > 2:
        places.append(_FOLDER.parents[2] / 'build' / 'lab' / 'abs_hil_lab.wasm')
    for place in places:
        if place.exists():
            return place.read_bytes()
    raise Unavailable('the simulation core for browsers (abs_hil_lab.wasm) is missing; scripts/lab.sh in the source folder '
                      'makes it, in a few minutes')


def _text(name: str) -> str:
    return (_FOLDER / 'page' / name).read_text(encoding='utf-8')


def page(exercise: dict[str, Any] | None) -> str:
    data = {'module': module(), 'page': json.dumps({'exercise': exercise}).encode()}
    own = "'use strict';\n(() => {\n" + ''.join(_text(name) for name in _SCRIPTS) + '})();\n'
    css = ((charts() / CHARTS_STYLE).read_text(encoding='utf-8')
           + (_FOLDER.parent / 'serve' / 'page' / 'serve.css').read_text(encoding='utf-8') + _text('lab.css'))
    return standalone('lab.html.j2', [_FOLDER / 'page'], data, [(charts() / CHARTS_SCRIPT).read_text(encoding='utf-8'), own], css,
                      more=" 'wasm-unsafe-eval'", title=exercise['title'] if exercise else 'The ABS lab', exercise=exercise,
                      version=_core.version)


def main(arguments: Sequence[str] | None = None) -> int:
    given = parsers.lab().parse_args(arguments)
    try:
        text = page(None if given.exercise is None else read(find(given.exercise)))
        write_text(given.out, text)
    except ValueError as error:
        return failed('abs_hil lab', error)
    print(f'{given.out}: {len(text.encode()) / 1e6:.1f} MB; open it in a browser')
    return 0
