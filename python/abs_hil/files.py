"""Files that are either complete or absent."""
from __future__ import annotations

import os
import pathlib
import tempfile
from collections.abc import Callable


def write_whole(path: pathlib.Path, write: Callable[[str], object], *, probe: bool = False) -> None:
    """Writes `path` by way of a file beside it, whose name `write` gets. A probe only tries whether that is possible.

    Raises ValueError, naming the path and the fix, if it cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f'.{path.name}.', dir=path.parent)
        os.close(handle)
        try:
            write(name)
            os.chmod(name, 0o666 & ~_umask())
            if probe:
                os.unlink(name)
            else:
                os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise
    except OSError as error:
        raise ValueError(f'cannot write "{path}": {error.strerror}; give a path in an existing, writable '
                         'directory') from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
