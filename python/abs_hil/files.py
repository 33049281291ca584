"""Files that are either complete or absent."""
import errno
import os
import pathlib
import tempfile
from collections.abc import Callable

from .core import _core

#: bytes that a text may have
_TEXT_MAX = 1 << 26


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
    """The system's words with a fix for a person (src/rig/error_words.cpp). deed: 'write', 'read' or 'reach'."""
    if not error.errno or error.errno < 0:  # as of a name that no server knows
        return error.strerror or str(error)
    return _core.refusal(error.errno, str(error.filename or '' if place is None else place), deed)


def read_text(path: pathlib.Path) -> str:
    """The text of a file. Raises OSError, also for one that no program here writes: a device may have no end."""
    with open(path, 'rb') as file:
        content = file.read(_TEXT_MAX + 1)
    if len(content) > _TEXT_MAX:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
    return content.decode('utf-8')


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
