"""Exercises of the lab: what a page says, hides and offers, from a TOML file."""
import math
import pathlib
import re
import tomllib
from typing import Any

from ..core import _core
from ..files import read_text
from ..messages import QUANTITIES
from ..simulation import simulate

#: table -> key -> type
_SHAPE: dict[str, dict[str, type]] = {
    '': {'title': str, 'task': str, 'start': dict, 'hidden': dict, 'offered': dict, 'goal': list},
    'start': {'controller': str, 'plant': str, 'experiment': str, 'set': dict},
    'hidden': {'set': dict, 'columns': list, 'figures': list},
    'offered': {'controllers': list, 'plants': list, 'experiments': list, 'keys': list},
    'goal': {'figure': str, 'at_most': float, 'at_least': float, 'says': str}}


def known() -> list[pathlib.Path]:
    """The ready exercises."""
    return sorted((pathlib.Path(__file__).parent / 'exercises').glob('*.toml'))


def find(name_or_file: str) -> pathlib.Path:
    return next((path for path in known() if path.stem == name_or_file), pathlib.Path(name_or_file))


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


def read(path: pathlib.Path) -> dict[str, Any]:
    """The exercise as the page takes it. Raises ValueError, naming the file, the value and what is valid."""
    place = str(path)
    try:
        given = tomllib.loads(read_text(path))
    except OSError as error:
        names = ', '.join(exercise.stem for exercise in known())
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
