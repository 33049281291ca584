"""abs_hil lab: a page that simulates the rig and its controllers in the browser, without a server (docs/lab.md).

One HTML file: the simulation core as WebAssembly, uPlot, and the page's own scripts. An exercise, a TOML file, says what the
page says, hides and offers.
"""
import argparse
import json
import math
import pathlib
import re
import tomllib
from typing import Any

from .. import parsers
from ..core import _core
from ..files import read_text, write_text
from ..messages import QUANTITIES
from ..options import as_main
from ..places import CHARTS_SCRIPT, CHARTS_STYLE, Unavailable, charts
from ..report.page import standalone
from ..simulation import simulate

_FOLDER = pathlib.Path(__file__).resolve().parent
#: in this order one script
_SCRIPTS = ('engine.js', 'settings.js', 'controls.js', 'figures.js', 'lab.js')
#: table -> key -> type
_SHAPE: dict[str, dict[str, type]] = {
    '': {'title': str, 'task': str, 'start': dict, 'hidden': dict, 'offered': dict, 'goal': list},
    'start': {'controller': str, 'plant': str, 'experiment': str, 'set': dict},
    'hidden': {'set': dict, 'columns': list, 'figures': list},
    'offered': {'controllers': list, 'plants': list, 'experiments': list, 'keys': list},
    'goal': {'figure': str, 'at_most': float, 'at_least': float, 'says': str}}


def exercises() -> list[pathlib.Path]:
    """The ready exercises."""
    return sorted((_FOLDER / 'exercises').glob('*.toml'))


def found(name_or_file: str) -> pathlib.Path:
    return next((path for path in exercises() if path.stem == name_or_file), pathlib.Path(name_or_file))


def _check(given: dict[str, Any], table: str, place: str) -> None:
    for key, value in given.items():
        wanted = _SHAPE[table].get(key)
        name = f'{table}.{key}'.lstrip('.')
        if wanted is None:
            raise ValueError(f'{place}: unknown key {name}; known: {", ".join(_SHAPE[table])}')
        if not isinstance(value, (int, float) if wanted is float else wanted) or isinstance(value, bool):
            raise ValueError(f'{place}: {name} = {value!r}: give a {"number" if wanted is float else wanted.__name__}')
        for number in value.values() if isinstance(value, dict) else [value]:
            if isinstance(number, float) and not math.isfinite(number):
                raise ValueError(f'{place}: {name} = {value!r}: give finite numbers')


def _among(names: list[Any], valid: list[str], key: str, place: str) -> None:
    for name in names:
        if name not in valid:
            some = ', '.join(valid[:20]) + (' ...' if len(valid) > 20 else '')
            raise ValueError(f'{place}: {key}: unknown "{name}"; known: {some}')


def read_exercise(path: pathlib.Path) -> dict[str, Any]:
    """The exercise as the page takes it. Raises ValueError, naming the file, the value and what is valid."""
    place = str(path)
    try:
        given = tomllib.loads(read_text(path))
    except OSError as error:
        names = ', '.join(exercise.stem for exercise in exercises())
        raise ValueError(f'--exercise "{path}": {error.strerror}; give a TOML file, or one of {names}') from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f'{place}: not valid TOML: {error}') from None
    _check(given, '', place)
    for needed in ('title', 'task'):
        if not given.get(needed):
            raise ValueError(f'{place}: {needed} is missing; give a text')
    for table in ('start', 'hidden', 'offered'):
        _check(given.get(table, {}), table, place)
    goals = given.get('goal', [])
    for goal in goals:
        _check(goal, 'goal', place)
    start, hidden, offered = ({'set': {}, **given.get(table, {})} for table in ('start', 'hidden', 'offered'))
    figures = [row['name'] for row in _core.figures()]
    keys = [row['name'] for row in _core.keys({})]
    for table, choice, valid in (('hidden', 'columns', QUANTITIES), ('hidden', 'figures', figures), ('offered', 'keys', keys),
                                 ('offered', 'controllers', _core.controllers()), ('offered', 'plants', _core.plants()),
                                 ('offered', 'experiments', _core.experiments())):
        _among(given.get(table, {}).get(choice, []), list(valid), f'{table}.{choice}', place)
    for key in offered.get('keys', []):
        if key in hidden['set']:
            raise ValueError(f'{place}: offered.keys: {key} is in hidden.set too; leave it out of one of the two')
    for goal in goals:
        _among([goal.get('figure')], figures, 'goal.figure', place)
        if not goal.get('says') or not {'at_most', 'at_least'} & goal.keys():
            raise ValueError(f'{place}: goal of {goal["figure"]}: give says, and at_most or at_least')
    try:  # what the program would refuse, the page must not bring
        simulate(**{name: value for name, value in start.items() if name != 'set'}, set={**start['set'], **hidden['set']})
    except ValueError as error:
        raise ValueError(f'{place}: {error}') from None
    # A line of the page begins at a blank line, a number or a dash; the file's own lines are as long as its writer likes.
    task = re.sub(r'(?<!\n)\n(?!\n|\d+\. |- ) *', ' ', given['task'].strip())
    return {'title': given['title'], 'task': task, 'start': start, 'offered': offered, 'goals': goals,
            'hidden': {'columns': [], 'figures': [], **hidden}}


def module() -> bytes:
    """The simulation core as WebAssembly: installed beside this file, in the source tree where scripts/lab.sh makes it."""
    for folder in (_FOLDER, *(root / 'build' / 'lab' for root in _FOLDER.parents[2:3])):
        if (place := folder / 'abs_hil_lab.wasm').exists():
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


@as_main(parsers.lab)
def main(given: argparse.Namespace) -> None:
    text = page(None if given.exercise is None else read_exercise(found(given.exercise)))
    write_text(given.out, text)
    print(f'{given.out}: {len(text.encode()) / 1e6:.1f} MB; open it in a browser')
