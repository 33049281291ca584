"""JSON and TOML from outside, without values that nest so deep that walking through them exhausts the stack."""
import json
import re
import tomllib
from collections.abc import Callable
from typing import Any

#: as in src/rig/nesting.hpp
MOST_LEVELS = 64
# tomllib takes time with the square of a name's parts. Names lie between characters that no name has.
_MOST_PARTS = 100
_OUTSIDE_NAMES = re.compile(r'''[^\w"'. \t-]+''')


def _checked(parse: Callable[[Any], Any], text: Any) -> Any:
    too_deep = ValueError(f'nested deeper than {MOST_LEVELS} levels')
    try:
        value = parse(text)
    except RecursionError:
        raise too_deep from None
    level = [value]
    for _ in range(MOST_LEVELS):
        level = [item for node in level if isinstance(node, (dict, list))
                 for item in (node.values() if isinstance(node, dict) else node)]
    if any(isinstance(item, (dict, list)) for item in level):
        raise too_deep
    return value


def parse_json(text: str | bytes) -> Any:
    """As json.loads. Raises ValueError also for what nests deeper than MOST_LEVELS."""
    return _checked(json.loads, text)


def parse_toml(text: str) -> dict[str, Any]:
    """As tomllib.loads. Raises ValueError also for what nests deeper than MOST_LEVELS."""
    if any(name.count('.') >= _MOST_PARTS for name in _OUTSIDE_NAMES.split(text)):
        raise ValueError(f'a name has more than {_MOST_PARTS} parts')
    return _checked(tomllib.loads, text)
