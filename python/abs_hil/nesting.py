"""JSON and TOML from outside, without values that nest so deep that walking through them exhausts the stack."""
import json
import re
import tomllib
from typing import Any

#: as in src/rig/nesting.hpp
MOST_LEVELS = 64
# tomllib takes time with the square of a name's parts. Names lie between characters that no name has.
_MOST_PARTS = 100
_OUTSIDE_NAMES = re.compile(r'''[^\w"'. \t-]+''')


def _checked(value: Any) -> Any:
    level, depth = [value], 0
    while level:
        if depth >= MOST_LEVELS:
            raise ValueError(f'nested deeper than {MOST_LEVELS} levels')
        inner = [item for node in level for item in (node.values() if isinstance(node, dict) else node)]
        level, depth = [item for item in inner if isinstance(item, (dict, list))], depth + 1
    return value


def parse_json(text: str | bytes) -> Any:
    """As json.loads. Raises ValueError also for what nests deeper than MOST_LEVELS."""
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError(f'nested deeper than {MOST_LEVELS} levels') from None
    return _checked(value) if isinstance(value, (dict, list)) else value


def parse_toml(text: str) -> dict[str, Any]:
    """As tomllib.loads. Raises ValueError also for what nests deeper than MOST_LEVELS."""
    if any(name.count('.') >= _MOST_PARTS for name in _OUTSIDE_NAMES.split(text)):
        raise ValueError(f'a name has more than {_MOST_PARTS} parts')
    try:
        value: dict[str, Any] = _checked(tomllib.loads(text))
    except RecursionError:
        raise ValueError(f'nested deeper than {MOST_LEVELS} levels') from None
    return value
