#!/usr/bin/env python3
"""usage: reproduce.py [BUILD] --check|--write|--list [--only NAME...] [--jobs N] [--fresh]

Makes every figure and table of the pages again: the rows of research/steps.toml, in order, --jobs of them at once [2]. --write
puts the results into the tree, --check compares them with it and ends with status 1 if a page differs or a step could not run.
BUILD is the folder of a release build [build/release].

A step that ended well is not run again while its command, scripts, programs, files and pages stay the same; so an interrupted
reproduction goes on where it was. --fresh forgets all that. Logs and state are below build/reproduce. Steps "by hand" run
only if --only names them. --list prints the rows.
"""
import argparse
import dataclasses
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

from steps import Place, Step, rows

ROOT = pathlib.Path(__file__).resolve().parent.parent
#: s between lines on progress
TELL_EVERY_S = 30.0


def listing(steps):
    lines = ['| step | makes | CPU | how |', '|---|---|---:|---|']
    for step in steps:
        how = f'by hand, {step.by_hand}' if step.by_hand else f'not compared: {step.presence}' if step.presence else 'compared'
        makes = ', '.join(step.makes) or 'a check alone'
        lines.append(f'| {step.name} | {makes} | {step.cpu_s / 60:.1f} min | {how} |')
    return '\n'.join(lines)


def same_sums():
    """Settings with which all processors that know AVX2 add in the same order: where one has AVX-512, OpenBLAS and numpy take
    more lanes, and so round in another way."""
    cpus = pathlib.Path('/proc/cpuinfo')
    flags = cpus.read_text(encoding='utf-8') if cpus.exists() else ''
    settings = {'OPENBLAS_CORETYPE': 'Haswell'} if ' avx2' in flags else {}
    if ' avx512f' in flags:
        settings['NPY_DISABLE_CPU_FEATURES'] = 'AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL'
    return settings


@dataclasses.dataclass
class Running:
    step: Step
    process: subprocess.Popen
    started: float


@dataclasses.dataclass
class Done:
    step: Step
    words: str
    differs: list[str] = dataclasses.field(default_factory=list)
    good: bool = True
    cpu_s: float = 0.0
    wall_s: float = 0.0


class Reproduction:
    def __init__(self, place, mode, jobs, say):
        self.place, self.mode, self.jobs, self.say = place, mode, jobs, say
        self.done, self.running = {}, []
        self.environment = {**os.environ, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1', 'PYTHONDONTWRITEBYTECODE': '1',
                            'ABS_BIN': str(place.build / 'bin'),
                            'PYTHONPATH': str(place.build / 'share' / 'abs_hil' / 'python'), **same_sums()}
        for folder in ('state', 'log'):
            (place.state / folder).mkdir(parents=True, exist_ok=True)

    def _kept(self, step):
        return self.place.state / 'state' / f'{step.name}.{self.mode.strip("-")}'

    def _end(self, step, words, **more):
        self.done[step.name] = Done(step, words, **more)
        self.say(f'{step.name}: {words}')

    def _start(self, step):
        """Starts a step, or says at once why it need not or cannot run."""
        kept = self._kept(step)
        if kept.exists() and kept.read_text() == self.place.key(step, self.mode):
            return self._end(step, 'as before')
        if lacking := self.place.lacks(step):
            return self._end(step, f'not run: it needs {lacking}', good=False)
        if bad := [name for name in step.after if name in self.done and not self.done[name].good]:
            return self._end(step, f'not run: {", ".join(bad)} did not end well', good=False)
        if step.manner() == 'out':
            out = self.place.state / 'out' / step.name
            shutil.rmtree(out, ignore_errors=True)
            for made in step.makes:
                (out / made).parent.mkdir(parents=True, exist_ok=True)
        log = self.place.state / 'log' / step.name
        with open(log.with_suffix('.out'), 'w') as printed, open(log.with_suffix('.err'), 'w') as told:
            process = subprocess.Popen(self.place.words(step, self.mode, self.jobs), cwd=self.place.root, env=self.environment,
                                       stdin=subprocess.DEVNULL, stdout=printed, stderr=told, start_new_session=True)
        self.running.append(Running(step, process, time.monotonic()))
        return None

    def _settle(self, run, status, used):
        step, log = run.step, self.place.state / 'log' / run.step.name
        figures = {'cpu_s': used.ru_utime + used.ru_stime, 'wall_s': time.monotonic() - run.started}
        printed = log.with_suffix('.out').read_text(encoding='utf-8')
        told = log.with_suffix('.err').read_text(encoding='utf-8')
        if step.manner() != 'prints' or not step.makes:
            told = printed + told
        if status:
            last = ' | '.join(told.strip().splitlines()[-8:])
            own = step.manner() == 'mode' or not step.makes
            differs = [f'{", ".join(step.makes) or step.name}: {last}'] if own else []
            words = 'differs' if own and status == 1 else f'failed with status {status}: {last} ({log}.err)'
            return self._end(step, words, differs=differs, good=False, **figures)
        try:
            differs = self.place.settle(step, self.mode, printed)
        except ValueError as error:
            differs = [f'{step.makes[0]}: {error}']
        if not differs:
            self._kept(step).write_text(self.place.key(step, self.mode))
        words = 'differs' if differs else 'made' if self.mode == '--write' else 'there' if step.presence else 'the same'
        return self._end(step, words, differs=differs, good=not differs, **figures)

    def _fits(self, step, waiting):
        """Whether a step may start beside the running ones: dependencies ended, a processor free, no page of theirs."""
        if any(other.name in step.after for other in [*waiting, *(run.step for run in self.running)]):
            return False
        files = {made.partition('#')[0] for made in step.makes}
        for run in self.running:
            if step.parallel or run.step.parallel or files & {made.partition('#')[0] for made in run.step.makes}:
                return False
        return len(self.running) < self.jobs

    def _reap(self):
        for run in list(self.running):
            pid, status, used = os.wait4(run.process.pid, os.WNOHANG)
            if pid:
                run.process.returncode = os.waitstatus_to_exitcode(status)
                self.running.remove(run)
                self._settle(run, run.process.returncode, used)

    def left_s(self, waiting):
        """An estimate from the rows' times."""
        now = time.monotonic()
        return (sum(step.cpu_s for step in waiting) / self.jobs
                + sum(max(0.0, run.step.cpu_s / (self.jobs if run.step.parallel else 1) - (now - run.started))
                      for run in self.running) / max(1, len(self.running)))

    def run(self, steps):
        waiting, told = list(steps), time.monotonic()
        try:
            while waiting or self.running:
                for step in list(waiting):
                    if self._fits(step, [other for other in waiting if other is not step]):
                        waiting.remove(step)
                        self._start(step)
                self._reap()
                if self.running and time.monotonic() - told > TELL_EVERY_S:
                    told = time.monotonic()
                    self.say(f'{len(self.done)} of {len(steps)} done; {", ".join(run.step.name for run in self.running)} '
                             f'running; about {self.left_s(waiting) / 60:.0f} min left')
                time.sleep(0.02)
        finally:
            for run in self.running:
                os.killpg(run.process.pid, signal.SIGTERM)
        return [self.done[step.name] for step in steps]


def report(done, by_hand, jobs):
    print('\n| step | result | CPU s | s |\n|---|---|---:|---:|')
    for one in done:
        print(f'| {one.step.name} | {one.words} | {one.cpu_s:.1f} | {one.wall_s:.1f} |')
    for step in by_hand:
        print(f'| {step.name} | by hand, {step.by_hand} | | |')
    cpu_s = sum(one.cpu_s or one.step.cpu_s for one in done)
    print(f'\nCPU time of these steps from nothing: {cpu_s / 60:.1f} min, on two processors about {cpu_s / 120:.1f} min')
    for one in done:
        for line in one.differs:
            print(line)
        if not one.good and not one.differs:
            print(f'{", ".join(one.step.makes) or one.step.name}: {one.words}')


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    modes = parser.add_mutually_exclusive_group(required=True)
    for mode in ('--check', '--write', '--list'):
        modes.add_argument(mode, dest='mode', action='store_const', const=mode)
    parser.add_argument('--only', action='extend', nargs='+', metavar='NAME', default=[])
    parser.add_argument('--jobs', '--threads', type=int, default=2)
    parser.add_argument('--fresh', action='store_true')
    parser.add_argument('--root', type=pathlib.Path, default=ROOT, help=argparse.SUPPRESS)
    parser.add_argument('build', type=pathlib.Path, nargs='?', metavar='BUILD')
    o = parser.parse_args()
    every = rows(o.root / 'research' / 'steps.toml')
    if unknown := set(o.only) - set(every):
        parser.error(f'--only: no step is called {", ".join(sorted(unknown))}; --list prints them')
    chosen = [step for step in every.values() if (step.name in o.only if o.only else not step.by_hand)]
    if o.mode == '--list':
        print(listing([step for step in every.values() if not o.only or step.name in o.only]))
        return 0
    build = (o.build or o.root / 'build' / 'release').resolve()
    if not (build / 'bin').is_dir():
        parser.error(f'{build}: no build; scripts/build.sh release makes build/release')
    state = o.root / 'build' / 'reproduce'
    if o.fresh:
        shutil.rmtree(state, ignore_errors=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    made = Reproduction(Place(o.root, build, state), o.mode, o.jobs,
                        lambda text: print(f'{time.strftime("%H:%M:%S")} {text}', flush=True))
    done = made.run(chosen)
    report(done, [] if o.only else [step for step in every.values() if step.by_hand], o.jobs)
    return 0 if all(one.good for one in done) else 1


if __name__ == '__main__':
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except ValueError as error:
        sys.exit(f'reproduce.py: {error}')
