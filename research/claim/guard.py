"""The generated parts of a page: to write them, and to check what the page prints against fresh runs."""
from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

_NUMBER = r'[-+−]?\d+(?:\.\d+)?'
NUMBER = re.compile(rf'(?<![\w.]){_NUMBER}')


def replaced(page: str, sections: Iterable[tuple[str, str]], phrases: Iterable[str] = ()) -> str:
    """The page with the text between each section's markers replaced, and the numbers of each phrase.

    A phrase is a sentence with fresh numbers; the page has it with any numbers and line breaks. Raises ValueError for
    missing markers and phrases.
    """
    for name, text in sections:
        pattern = re.compile(f'(<!-- begin {name} -->\n).*?(<!-- end {name} -->)', re.S)
        parts = list(pattern.finditer(page))
        if len(parts) != 1:
            raise ValueError(f'expected the markers of {name} once, found them {len(parts)} times')
        page = f'{page[:parts[0].start()]}{parts[0][1]}\n{text.strip()}\n\n{parts[0][2]}{page[parts[0].end():]}'
    for phrase in phrases:
        found = list(_pattern_of(phrase).finditer(page))
        if len(found) != 1:
            raise ValueError(f'expected this phrase once, with any numbers, found it {len(found)} times: {phrase}')
        fresh = NUMBER.findall(phrase)
        for index in range(len(fresh), 0, -1):
            begin, end = found[0].span(index)
            page = page[:begin] + fresh[index - 1] + page[end:]
    return page


def _pattern_of(phrase: str) -> re.Pattern[str]:
    parts = [re.sub(r'(\\ )+', r'\\s+', re.escape(part)) for part in NUMBER.split(phrase)]
    return re.compile(f'({_NUMBER})'.join(parts))


def differences(before: str, after: str, tolerance: float) -> list[str]:
    """Pairs of lines of two versions of a page whose words differ, or of whose numbers one differs by more than
    `tolerance` of its size and one in its last digit."""
    old, new = before.splitlines(), after.splitlines()
    if len(old) != len(new):
        changed = [line for line in difflib.unified_diff(old, new, lineterm='', n=0) if line[:3] not in ('---', '+++')]
        return ['\n'.join([f'{len(old)} lines, now {len(new)}', *changed[:20]])]
    return [f'- {one}\n+ {two}' for one, two in zip(old, new) if not _same(one, two, tolerance)]


def _same(one: str, two: str, tolerance: float) -> bool:
    if NUMBER.sub('#', one) != NUMBER.sub('#', two):
        return False
    for a, b in zip(NUMBER.findall(one), NUMBER.findall(two)):
        x, y = float(a.replace('−', '-')), float(b.replace('−', '-'))
        if abs(x - y) > tolerance * abs(x) + 1.01 * 10.0 ** -len(a.partition('.')[2]):
            return False
    return True
