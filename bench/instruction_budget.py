#!/usr/bin/env python3
"""usage: instruction_budget.py BENCH_INSTRUCTION_COUNT

Counts instructions a cycle with callgrind, which gives the same figure on every run, and compares them with their
budgets. Status 1 if one is exceeded, 77 where valgrind is missing.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

# function -> (what it is, budget in instructions a cycle)
BUDGETS = {
    'counted_control': ('observers, sequence, adaptive controller, gate', 1000),
    'counted_ring_push': ('ring push of one record', 150),
    'counted_statistics': ('five histograms', 150),
}


def count(program, function):
    """Instructions of all calls of one function, what it calls included, and the cycles of the run."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / 'callgrind.out'
        run = subprocess.run(['valgrind', '--tool=callgrind', f'--toggle-collect={function}',
                              f'--callgrind-out-file={out}', program], capture_output=True, text=True)
        if run.returncode:
            sys.exit(f'{program} under callgrind ended with status {run.returncode}:\n{run.stderr}')
        total = int(re.search(r'^(?:totals|summary):\s*(\d+)', out.read_text(), re.MULTILINE).group(1))
        return total, int(run.stdout)


def main():
    if not shutil.which('valgrind'):
        print('SKIPPED: valgrind is not installed')
        return 77
    over = False
    for function, (what, budget) in BUDGETS.items():
        total, cycles = count(sys.argv[1], function)
        per_cycle = total / cycles
        exceeded = not 0 < per_cycle <= budget
        over = over or exceeded
        print(f'{what:<50} {per_cycle:8.1f} of {budget} instructions a cycle{" EXCEEDED" if exceeded else ""}')
    return 1 if over else 0


if __name__ == '__main__':
    sys.exit(main())
