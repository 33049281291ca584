#!/usr/bin/env python3
"""usage: study_scale.py BUILD [--write]

Measures what a study costs beside its runs, for planning: start of a task, bytes of a run, time to write a chunk, memory,
and what becomes of the rate if a study is parted into short tasks. Prints the table of docs/studies.md, or writes it there.
Rates are ratios to the rate of one process, measured side by side, since other programs may load this computer.
"""
import gzip
import os
import pathlib
import subprocess
import sys
import tempfile
import time

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import write  # noqa: E402


STUDY = '''controllers = ["adaptive"]
chunk = {chunk}
[design]
kind = "sobol"
points = {points}
[factors]
plant.theta_N = {{ from = 15, to = 30 }}
plant.B = {{ from = 20, to = 30 }}
plant.c31_per_s = {{ from = 18, to = 22 }}
'''
#: braking ends after a few cycles: many runs in little time
SHORT = '[settings]\nexperiment.start_speed_rad_s = 155\nexperiment.end_speed_m_s = 15.0\n'
RUNS = 800


class Scale:
    def __init__(self, program, folder):
        self.program, self.folder, self.calls = program, pathlib.Path(folder), 0

    def study(self, points, chunk, short=False):
        path = self.folder / f'{points}-{chunk}{"-short" if short else ""}.toml'
        path.write_text(STUDY.format(points=points, chunk=chunk) + (SHORT if short else ''))
        return path

    def run(self, study, *options, out=None):
        """CPU time in s, largest memory in MB, folder of the results."""
        self.calls += 1
        out = out or self.folder / f'out-{self.calls}'
        process = subprocess.Popen([self.program, 'study', study, '--out', out, '--threads', '1', *options],
                                   stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        if status != 0:
            raise SystemExit(f'status {status} of {study} {options}')
        return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, out

    def parted(self, chunks_in_task):
        """CPU time of all tasks and the merge, over that of one process."""
        chunk = 10
        tasks = RUNS // (chunk * chunks_in_task)
        study = self.study(RUNS, chunk)
        whole, _, _ = self.run(study)
        out = self.folder / f'parted-{chunks_in_task}'
        parts = sum(self.run(study, '--shard', f'{i}/{tasks}', out=out)[0] for i in range(1, tasks + 1))
        return parts / whole, whole / RUNS


def main():
    build = pathlib.Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        scale = Scale(build / 'bin' / 'abs_hil', folder)
        start_s = min(scale.run(scale.study(1, 1, short=True))[0] for _ in range(5))
        _, _, out = scale.run(scale.study(RUNS, 1000))
        packed = (out / 'results.csv.gz').stat().st_size / RUNS
        with gzip.open(out / 'results.csv.gz') as file:
            plain = len(file.read()) / RUNS
        few, _, _ = scale.run(scale.study(20_000, 20_000, short=True))
        many, _, _ = scale.run(scale.study(20_000, 50, short=True))
        _, many_MB, _ = scale.run(scale.study(100_000, 1000, short=True))
        _, ten_MB, _ = scale.run(scale.study(10_000, 1000, short=True))
        parted = {10 * chunks: scale.parted(chunks) for chunks in (1, 4, 20)}
        text = f'''| | measured here |
|---|---|
| CPU time of a task beside its runs: start, study, folder | {1e3 * start_s:.0f} ms |
| CPU time of one run of `adaptive` on `paper-table1`, in lanes | {1e3 * min(run for _, run in parted.values()):.1f} ms |
| CPU time to write one more chunk | {1e3 * (many - few) / (20_000 / 50):.2f} ms |
| a row, as text and in the results | {plain:.0f} and {packed:.0f} bytes |
| memory of a study of 10,000 and of 100,000 runs | {ten_MB:.0f} and {many_MB:.0f} MB |
| CPU time of a study in tasks of {", ".join(map(str, parted))} runs, over that of one process | {", ".join(
            f"{ratio:.2f}" for ratio, _ in parted.values())} |
'''
    if '--write' not in sys.argv:
        print(text, end='')
        return 0
    write('studies.md', 'plan', text)
    return 0


if __name__ == '__main__':
    started = time.monotonic()
    status = main()
    print(f'study_scale: {time.monotonic() - started:.0f} s', file=sys.stderr)
    sys.exit(status)
