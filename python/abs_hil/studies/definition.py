"""What a study's own text says of its factors and its design."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..nesting import parse_toml

_RANGE_KEYS = {'from', 'to', 'steps', 'mean', 'sd'}


class Definition:
    """design: its kind; ranges: names of the factors whose values a design spreads; levels: of those with lists or steps."""

    def __init__(self, text: str) -> None:
        parsed = parse_toml(text)
        self.description: str = parsed.get('description', '')
        self.design: str = parsed.get('design', {}).get('kind', 'grid')
        self.levels: list[str] = []
        self.ranges: list[str] = []
        self._collect(parsed.get('factors', {}), '')

    def _collect(self, table: Mapping[str, Any], prefix: str) -> None:
        for key, value in table.items():
            name = prefix + key
            if isinstance(value, Mapping) and not _RANGE_KEYS & value.keys():
                self._collect(value, name + '.')
            elif isinstance(value, Mapping) and 'steps' not in value:
                self.ranges.append(name)
            else:
                self.levels.append(name)
