"""abs_hil study submit on a real Slurm of three nodes: tasks cancelled, requeued and lost with their node; in the end the
bytes of one process.

usage: slurm_test.py ABS_HIL. Enters namespaces of its own. Status 77 where Slurm, root or namespaces cannot be had.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from slurm_cluster import Cluster, missing

NODES, TASKS, CHUNK = 3, 7, 50
INSIDE = 'ABS_HIL_SLURM_TEST_INSIDE'
#: of computing, so that there is time to disturb it
WORK_S = 40.0

STUDY = '''
controllers = ["adaptive", "pi"]
chunk = {chunk}
[design]
kind = "sobol"
points = {points}
[factors]
plant.theta_N = {{ from = 15, to = 30 }}
plant.B = {{ from = 20, to = 30 }}
'''


def enter(arguments):
    """Runs this file inside namespaces of its own."""
    words = ['unshare', '--net', '--pid', '--fork', '--mount-proc', '--propagation', 'unchanged', '--kill-child']
    if why := missing() or ('' if subprocess.run([*words, 'true']).returncode == 0 else 'no namespaces here'):
        print(f'SKIPPED: {why}')
        return 77
    return subprocess.run([*words, sys.executable, *arguments], env=dict(os.environ, **{INSIDE: '1'})).returncode


class Studies:
    def __init__(self, program, cluster, folder):
        self.program, self.cluster, self.folder = program, cluster, folder
        self.study = folder / 'study.toml'

    def call(self, *words, status=0):
        done = self.cluster.run(self.program, 'study', *map(str, words), check=False)
        assert done.returncode == status, (words, done.returncode, done.stdout, done.stderr)
        return done.stdout

    def write(self, points):
        self.study.write_text(STUDY.format(chunk=CHUNK, points=points))

    def points_for(self, seconds):
        self.write(200)
        start = time.monotonic()
        self.call(self.study, '--out', self.folder / 'rate', '--threads', 1)
        return max(4 * CHUNK, int(200 * seconds / (time.monotonic() - start)))

    def results(self, name):
        return (self.folder / name / 'results.csv.gz').read_bytes()


def task(cluster, job, wanted):
    """The first task of the job in that state, after it has had time to begin."""
    def found():
        return next((entry for entry in cluster.active() if entry[0].startswith(f'{job}_') and entry[1] == wanted), None)
    return cluster.wait(found, f'a task of job {job} is {wanted}')


def chunks(folder):
    return len(list((folder / 'parts').glob('[0-9]*.csv.gz')))


def disturb(cluster, out, job):
    """Cancels a task, requeues one, loses a node with one. Returns the cancelled one."""
    cluster.wait(lambda: chunks(out) >= 3, 'some chunks are there')
    cancelled = task(cluster, job, 'RUNNING')
    cluster.run('scancel', '--signal=KILL', '--full', cancelled[0])
    cluster.run('scancel', cancelled[0])
    print(f'cancelled {cancelled[0]} with {chunks(out)} chunks there', flush=True)
    cluster.wait(lambda: all(entry[0] != cancelled[0] for entry in cluster.active()), 'the cancelled task is gone')
    requeued = task(cluster, job, 'RUNNING')
    cluster.run('scontrol', 'requeue', requeued[0])
    print(f'requeued {requeued[0]} with {chunks(out)} chunks there', flush=True)
    def other():
        return next((entry for entry in cluster.active() if entry[1] == 'RUNNING' and entry[0] != requeued[0]), None)
    lost = cluster.wait(other, 'another task runs')
    cluster.lose_node(lost[2])
    print(f'lost node {lost[2]} with {lost[0]} and {chunks(out)} chunks there', flush=True)
    cluster.wait(lambda: 'down' in cluster.state(lost[2]), 'the node is down')
    again = cluster.wait(lambda: [entry for entry in cluster.active() if entry[0] == lost[0]], 'its task is queued again')
    print(f'queued again: {again}', flush=True)
    cluster.bring_back(lost[2])
    return cancelled[0]


def check(program, folder):
    cluster = Cluster(folder / 'cluster', NODES)
    cluster.folder.mkdir()
    cluster.start()
    studies = Studies(program, cluster, folder)
    points = studies.points_for(WORK_S)
    studies.write(points)
    runs, total = 2 * points, -(-2 * points // CHUNK)
    out = folder / 'out'

    submitted = studies.call('submit', studies.study, '--array', TASKS, '--out', out, '--', '--time=20')
    print(submitted, end='', flush=True)
    job, merge = re.search(r'of job (\d+), then merge in job (\d+)', submitted).groups()
    cancelled = disturb(cluster, out, job)
    assert 'RUNNING' in studies.call('status', out) or not cluster.active()
    cluster.wait(lambda: not cluster.active(), 'all jobs have ended', 600)
    states = {entry[0]: entry[1] for entry in cluster.jobs()}
    assert states.pop(cancelled) == 'CANCELLED', states
    assert states.pop(merge) == 'FAILED', states  # chunks of the cancelled task are missing
    assert set(states.values()) == {'COMPLETED'} and len(states) == TASKS - 1, states
    status = studies.call('status', out)
    print(status, flush=True)
    there = chunks(out)
    assert f'{there} of {total} chunks' in status and there < total, (status, there, total)
    assert 'chunks are missing' in next(out.glob('slurm/*-merge.log')).read_text()

    # What is missing is computed alone, and then merged.
    submitted = studies.call('submit', studies.study, '--array', TASKS, '--out', out, '--', '--time=20')
    print(submitted, end='', flush=True)
    assert f'{total - there} chunks in' in submitted, submitted
    cluster.wait(lambda: not cluster.active(), 'all jobs have ended', 600)
    assert f'complete, {runs} runs' in studies.call('status', out)
    assert not (out / 'parts').exists()
    studies.call(studies.study, '--out', folder / 'alone')
    assert studies.results('out') == studies.results('alone')
    assert 'nothing to submit' in studies.call('submit', studies.study, '--array', TASKS, '--out', out)
    print(f'{runs} runs in {TASKS} tasks on {NODES} nodes: the bytes of one process')


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    if INSIDE not in os.environ:
        return enter([__file__, program])
    with tempfile.TemporaryDirectory(prefix='abs_slurm_') as folder:
        os.chmod(folder, 0o755)  # munge's own user must reach its socket
        try:
            check(program, pathlib.Path(folder))
        except AssertionError:
            for log in sorted(pathlib.Path(folder).glob('**/*.log')):
                print(f'== {log}\n{log.read_text(errors="replace")[-3000:]}')
            raise
    return 0


if __name__ == '__main__':
    sys.exit(main())
