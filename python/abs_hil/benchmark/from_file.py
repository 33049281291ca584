"""Runs of controllers from shared libraries and FMUs, by the program abs_hil: each in a process of its own."""
from __future__ import annotations

import concurrent.futures
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

from ..options import text_of


def program() -> str:
    """The program abs_hil: of this build tree, beside this Python, or in the PATH. Raises ValueError without one."""
    try:
        from .._build_tree import PROGRAM
    except ImportError:
        beside = pathlib.Path(sys.executable).with_name('abs_hil')
        found = str(beside) if beside.exists() else shutil.which('abs_hil')
    else:
        found = str(PROGRAM)
    if found is None:
        raise ValueError('controllers from files are run by the program abs_hil, which is not in the PATH; install it')
    return found


def _summary(run: Mapping[str, Any]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        target = pathlib.Path(folder, 'summary.json')
        words = [program(), '--fast', '--no-lcm', '--summary', str(target)]
        for name in ('controller', 'plant', 'experiment', 'seed'):
            words += [f'--{name}', str(run[name])]
        words += [word for key, value in run['set'].items() for word in ('--set', f'{key}={text_of(value)}')]
        ended = subprocess.run(words, capture_output=True, text=True)
        # 1: a fault ended the run, which its summary says.
        if ended.returncode not in (0, 1) or not target.exists():
            raise ValueError((ended.stderr.strip().splitlines() or [f'abs_hil ended with status {ended.returncode}'])[-1])
        return dict(json.loads(target.read_text(encoding='utf-8')))


def summaries_of(runs: Sequence[Mapping[str, Any]], threads: int) -> list[dict[str, Any]]:
    """The summaries of the runs, in their order. Raises ValueError for the first that cannot be started."""
    with concurrent.futures.ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        return list(pool.map(_summary, runs))
