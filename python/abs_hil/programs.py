"""The programs in Python: abs_report, abs_tune, abs_learn, abs_identify, abs_benchmark,
abs_convert. `abs_hil report ...` starts them too."""
from __future__ import annotations

import importlib
import os
import sys

#: name -> module with main(arguments) -> exit status
PROGRAMS = {'report': 'abs_hil.report.program', 'tune': 'abs_hil.tune', 'learn': 'abs_hil.learning.program',
            'identify': 'abs_hil.identification.program', 'benchmark': 'abs_hil.benchmark.program',
            'convert': 'abs_hil.interchange.program'}


def start(name: str, arguments: list[str]) -> int:
    # Our matrices are small. More threads of BLAS would only spin, and wear other programs' cores.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    try:
        module = importlib.import_module(PROGRAMS[name])
    except ImportError as error:
        print(f'abs_{name}: {error}. On Debian, scripts/setup.sh in the source folder installs what it needs; elsewhere: '
              'pip install .', file=sys.stderr)
        return 3
    try:
        return int(module.main(arguments))
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        return 0


def report() -> None:
    sys.exit(start('report', sys.argv[1:]))


def tune() -> None:
    sys.exit(start('tune', sys.argv[1:]))


def learn() -> None:
    sys.exit(start('learn', sys.argv[1:]))


def identify() -> None:
    sys.exit(start('identify', sys.argv[1:]))


def benchmark() -> None:
    sys.exit(start('benchmark', sys.argv[1:]))


def convert() -> None:
    sys.exit(start('convert', sys.argv[1:]))
