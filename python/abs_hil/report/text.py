"""Texts of a report: text from files made fit to show, and numbers as people read them."""
import math
import os

from ..core import _core

MINUS = '\u2212'
DASH = '–'


def clean(text: object, most: int = 200) -> str:
    """Text from a file or a file's name, fit to show: no control characters, at most `most` characters."""
    try:
        data = str(text).encode('utf-8', 'surrogateescape')
    except UnicodeEncodeError:
        data = str(text).encode('utf-8', 'replace')
    return _core.clean_text(data, most)


def short_names(names: list[str], most: int) -> list[str]:
    """Names cut to `most` characters; names that would then look alike lose their common beginning instead."""
    cut = [clean(name, most) for name in names]
    shorts = []
    for name, short in zip(names, cut):
        alike = [other for other, of_other in zip(names, cut) if of_other == short]
        begin = max(0, min(len(os.path.commonprefix(alike)), min(map(len, alike)) - 2))
        shorts.append(short if len(alike) == 1 else '…' + clean(name[begin:], most - 1))
    return shorts


def shown(value: float | None, decimals: int) -> str:
    """A number with fixed decimals and a true minus sign; a dash for NaN and infinity."""
    if value is None or not math.isfinite(value):
        return DASH
    text = f'{value:.{decimals}f}'
    if text.strip('-0.') == '':
        text = text.lstrip('-')
    return text.replace('-', MINUS)


def rounded(values: list[float], spread: float) -> list[str]:
    """Values with the decimals that their spread tells: two digits of it."""
    if not (math.isfinite(spread) and spread > 0.0):
        return [significant(value, 4) for value in values]
    decimals = max(0, 1 - math.floor(math.log10(spread)))
    return [shown(value, decimals) for value in values]


def significant(value: float, digits: int) -> str:
    return f'{value:.{digits}g}'.replace('-', MINUS) if math.isfinite(value) else DASH


def number_text(value: object) -> str:
    """A configuration value: 23.0 of the summary and 23 of config.toml become the same text."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        return repr(int(value)) if value.is_integer() and abs(value) < 1e16 else repr(value)
    return clean(value)
