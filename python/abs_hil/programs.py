"""The programs in Python: abs_NAME, which `abs_hil NAME` starts too, for each name of PROGRAMS but the last two: abs_hil itself
starts those."""
import codecs
import contextlib
import errno
import importlib
import io
import os
import pathlib
import sys
import warnings
from typing import Any

from . import parsers
from .places import misfit

#: name -> module with main(arguments) -> exit status
PROGRAMS = {'report': '.report.program', 'tune': '.tune', 'learn': '.learning.training', 'identify': '.identification.program',
            'benchmark': '.benchmark.program', 'convert': '.interchange.recorded', 'watch': '.watch.program',
            'export-fmu': '.interchange.export_fmu', 'serve': '.serve.program', 'lab': '.lab.page', 'log': '.log', 'rig': '.rig',
            'compare_tables': '.compare', 'python_host': '.interchange.host'}
#: for encodings without them
_PLAIN = {'\u2212': b'-', '–': b'-', '×': b'x', '…': b'...'}


def _plainly(error: UnicodeError) -> tuple[bytes, int]:
    """What standard output gets of characters that its encoding lacks; the bytes of a file's name as they are."""
    assert isinstance(error, UnicodeEncodeError)
    lacking = error.object[error.start:error.end]
    return b''.join(bytes([ord(c) & 0xFF]) if '\udc80' <= c <= '\udcff' else _PLAIN.get(c, b'?') for c in lacking), error.end


class _Output(io.FileIO):
    """Standard output that remembers why it could not be written."""
    problem: OSError | None = None
    endless = False  #: the program goes on until nobody reads; any other ends its work, for its files

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            self.problem = error
            if error.errno == errno.EPIPE and not self.endless:
                return len(data)
            raise


def start(name: str, arguments: list[str]) -> int:
    """Starts a program. A full disk behind stdout is status 1, whatever the program made of it."""
    for number in range(3):  # a closed one is as /dev/null, and no other file takes its number
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout, sys.stderr = (stream or open(os.devnull, 'w', encoding='utf-8') for stream in (sys.stdout, sys.stderr))
    raw = _Output(1, 'wb', closefd=False)
    raw.endless = name == 'watch'
    codecs.register_error('abs_hil', _plainly)
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), encoding=sys.stdout.encoding, errors='abs_hil',
                                  line_buffering=bool(sys.stdout.line_buffering))
    status = _start(name, arguments)
    with contextlib.suppress(OSError):
        sys.stdout.flush()
    try:
        sys.stderr.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    if raw.problem is None:
        return status
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Python tries once more at its end
    if raw.problem.errno == errno.EPIPE:
        return status
    print(f'abs_{name}: cannot write to standard output: {raw.problem.strerror}', file=sys.stderr)
    return 1


def _start(name: str, arguments: list[str]) -> int:
    # Our matrices are small. More threads of BLAS would only spin, and wear other programs' cores.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    if name == 'compare_tables':
        warnings.simplefilter('ignore')  # a module older than the program does not matter: the program has made the runs
    said = io.StringIO()  # NumPy prints a page about packages that do not fit it
    try:
        if '--version' in arguments:
            from .core import _core
            print(f'abs_{name} {_core.version}' + (f' ({_core.revision})' if _core.revision != 'unknown' else ''))
            return 0
        getattr(parsers, name.replace('-', '_'))().parse_args(arguments)  # --help and wrong options end here, without a package
        with contextlib.redirect_stderr(said):
            main = importlib.import_module(PROGRAMS[name], __package__).main
        print(end=said.getvalue(), file=sys.stderr)
        return int(main(arguments))
    except SystemExit as end:  # of argparse
        return end.code if isinstance(end.code, int) else 0
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        return 0
    except Exception as error:
        if not (text := misfit(error) or (error if isinstance(error, ImportError) else '')):
            raise
        print(f'abs_{name}: {text}', file=sys.stderr)
        return 3


def command() -> None:
    """What pip installs as abs_NAME: starts the program of that name."""
    sys.exit(start(pathlib.Path(sys.argv[0]).stem.removeprefix('abs_'), sys.argv[1:]))
