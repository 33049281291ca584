#!/usr/bin/env python3
"""usage: study_million.py BUILD [--points N] [--slurm] [--write]

Runs examples/studies/million.toml on all processors, then reads its results in Python: quantiles of all metrics, and a map of
the stop distance over theta and B. Prints times and memory, or writes them into docs/studies.md (--write).
--slurm: the same study as seven tasks of an array job on a Slurm of two nodes, which the script starts in a private network
namespace (root; scripts/setup.sh packages-slurm.txt); ends with status 1 unless the results are the same bytes.
--points: fewer runs, for a try.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import ROOT, write  # noqa: E402

TASKS, NODES = 7, 2
INSIDE = 'ABS_HIL_MILLION_INSIDE'

READ = '''
import sys, abs_hil
study = abs_hil.load_study(sys.argv[1])
print(study.quantiles().to_string(), file=sys.stderr)
print(study.map("plant.theta_N", "plant.B", "stop_distance_m").round(3).to_string(), file=sys.stderr)
'''


def measured(words, **options):
    """Wall time in s, CPU time in s, largest memory in MB of a process."""
    started = time.monotonic()
    process = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL, **options)
    _, status, used = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f'status {status} of {words}')
    return time.monotonic() - started, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def through_slurm(program, study, folder):
    """Wall time in s of the array job and its merge, and the results' bytes."""
    sys.path.insert(0, str(ROOT / 'tests' / 'app'))
    from slurm_cluster import Cluster
    (folder / 'cluster').mkdir()
    cluster = Cluster(folder / 'cluster', NODES)
    cluster.start()
    out = folder / 'slurm'
    started = time.monotonic()
    submitted = cluster.run(program, 'study', 'submit', study, '--array', str(TASKS), '--out', str(out), '--', '--time=120')
    print(submitted.stdout, end='', file=sys.stderr, flush=True)
    cluster.wait(lambda: not cluster.active(), 'all jobs have ended', 7200)
    states = [state for _, state, _ in cluster.jobs()]
    if set(states) != {'COMPLETED'} or len(states) != TASKS + 1:
        raise SystemExit(f'states of the jobs: {states}')
    return time.monotonic() - started, (out / 'results.csv.gz').read_bytes()


def table(o, folder):
    program = str((o.build / 'bin' / 'abs_hil').resolve())
    study = folder / 'million.toml'
    text = (ROOT / 'examples' / 'studies' / 'million.toml').read_text()
    study.write_text(re.sub(r'(?m)^points = .*', f'points = {o.points}', text))
    wall_s, cpu_s, memory_MB = measured([program, 'study', study, '--out', folder / 'whole'])
    print(f'{o.points} runs: {wall_s:.0f} s', file=sys.stderr, flush=True)
    environment = dict(os.environ, PYTHONPATH=str(o.build.resolve() / 'share' / 'abs_hil' / 'python'), OPENBLAS_NUM_THREADS='1')
    read_s, _, read_MB = measured([sys.executable, '-c', READ, folder / 'whole'], env=environment)
    rows = [f'| {o.points:,} runs on {os.cpu_count()} processors | {wall_s:.0f} s, {o.points / wall_s:,.0f} runs/s |',
            f'| CPU time of a run | {1e6 * cpu_s / o.points:.0f} µs |',
            f'| memory of the program | {memory_MB:.0f} MB |',
            f'| quantiles of all metrics and a map, in Python | {read_s:.0f} s, {read_MB:.0f} MB |']
    if o.slurm:
        slurm_s, results = through_slurm(program, str(study), folder)
        if results != (folder / 'whole' / 'results.csv.gz').read_bytes():
            raise SystemExit('the results through Slurm are other bytes')
        rows.append(f'| as {TASKS} tasks through Slurm on {NODES} nodes of one processor each | {slurm_s:.0f} s, the same bytes |')
    return '| | measured here |\n|---|---|\n' + '\n'.join(rows) + '\n'


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('build', type=pathlib.Path)
    parser.add_argument('--points', type=int, default=1_000_000)
    parser.add_argument('--slurm', action='store_true')
    parser.add_argument('--write', action='store_true')
    o = parser.parse_args()
    if o.slurm and INSIDE not in os.environ:
        words = ['unshare', '--net', '--pid', '--fork', '--mount-proc', '--kill-child', sys.executable, *sys.argv]
        return subprocess.run(words, env=dict(os.environ, **{INSIDE: '1'})).returncode
    with tempfile.TemporaryDirectory(prefix='abs_million_') as folder:
        os.chmod(folder, 0o755)  # munge's own user must reach its socket
        text = table(o, pathlib.Path(folder))
    print(text, end='')
    if o.write:
        write('studies.md', 'million', text)
    return 0


if __name__ == '__main__':
    sys.exit(main())
