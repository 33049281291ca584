"""Files that are either complete or absent; and JSON and TOML from outside, without values that nest so deep that walking through
them exhausts the stack."""
import errno
import json
import os
import pathlib
import re
import tempfile
import tomllib
from collections.abc import Callable
from typing import Any

from .core import _core

#: bytes that a text may have
_TEXT_MAX = 1 << 26
#: as in src/rig/nesting.hpp
MOST_LEVELS = 64
# tomllib takes time with the square of a name's parts. Names lie between characters that no name has.
_MOST_PARTS = 100
_OUTSIDE_NAMES = re.compile(r'''[^\w"'. \t-]+''')


def write_whole(path: str | os.PathLike[str], write: Callable[[str], object], *, probe: bool = False) -> None:
    """Writes `path` as the program writes its results (files/result_file.hpp): by way of a file beside it, whose name `write`
    gets. A link, a device or a pipe is never replaced. A probe only tries whether that is possible.

    Raises ValueError, naming the path and the fix, if it cannot be written.
    """
    def into(part: bytes) -> bytes:
        if part:
            write(os.fsdecode(part))
            return b''
        with tempfile.TemporaryDirectory() as folder:  # for a stream, which gets the bytes when all are there
            whole = pathlib.Path(folder, 'whole')
            whole.touch()
            write(str(whole))
            return whole.read_bytes()
    try:
        _core.write_result(os.fsencode(path), into, probe)
    except OSError as error:
        raise ValueError(f'cannot write "{path}": {refusal(error, path)}' if error.strerror else str(error)) from None


def refusal(error: OSError, place: object = None, deed: str = 'write') -> str:
    """The system's words with a fix for a person (src/rig/formatted_text.cpp). deed: 'write', 'read' or 'reach'."""
    if not error.errno or error.errno < 0:  # as of a name that no server knows
        return error.strerror or str(error)
    return _core.refusal(error.errno, str(error.filename or '' if place is None else place), deed)


def read_text(path: pathlib.Path, errors: str = 'strict') -> str:
    """The text of a file. Raises OSError, also for one that no program here writes: a device may have no end."""
    with open(path, 'rb') as file:
        content = file.read(_TEXT_MAX + 1)
    if len(content) > _TEXT_MAX:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
    return content.decode('utf-8-sig', errors)


def make_folder(folder: pathlib.Path, option: str) -> None:
    """Makes a folder for results, if there is none. Raises ValueError if that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f'{option} "{folder}" cannot be made: {refusal(error, folder)}') from None


def refuse_existing(path: pathlib.Path, option: str, replace: bool) -> None:
    """Raises ValueError if a file is there and may not be replaced. A device or a pipe keeps nothing."""
    if not replace and path.is_file():
        raise ValueError(f'"{path}" exists; give another {option}, or --force to replace it')


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """write_whole for a text."""
    write_whole(path, lambda name: pathlib.Path(name).write_text(text, encoding='utf-8'))


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
