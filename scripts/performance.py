#!/usr/bin/env python3
"""usage: performance.py [--output FILE] [--lanes]

Runs the benchmarks of build/release, and the same braking in Octave and SciPy if they are installed. Writes
build/release/performance.md; docs/reference/performance.md has the main figures. Each figure is the median of repetitions. The repetitions of one program's benchmarks are
interleaved. --lanes renews the section on many runs alone. `scripts/setup_python.sh python-packages-bench.txt` installs
numba for it, which it compares with if it is there.
"""
import argparse
import json
import os
import pathlib
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BIN = ROOT / 'build' / 'release' / 'bin'
REPETITIONS = 9


def bench(program, repetitions=REPETITIONS):
    """{name: (median CPU ns, counters)} of a benchmark program."""
    with tempfile.NamedTemporaryFile(suffix='.json') as out:
        subprocess.run([BIN / program, f'--benchmark_repetitions={repetitions}', '--benchmark_enable_random_interleaving=true',
                        '--benchmark_min_time=0.02', f'--benchmark_out={out.name}', '--benchmark_out_format=json'],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        runs = json.load(open(out.name))['benchmarks']
    unit = {'ns': 1.0, 'us': 1e3, 'ms': 1e6}
    found = {}
    for run in runs:
        if run['run_type'] == 'aggregate' and run['aggregate_name'] == 'median':
            name = re.sub(r'/iterations:\d+|/real_time|/process_time|_median$', '', run['name'])
            found[name] = (run['cpu_time'] * unit[run['time_unit']], run)
    return found


def whole_process(arguments, environment=None):
    """Median CPU ms and peak MB of a command and its child processes."""
    cpu_ms, peak_mb = [], 0.0
    for _ in range(REPETITIONS):
        pid = os.posix_spawn(arguments[0], arguments, environment or os.environ,
                             file_actions=[(os.POSIX_SPAWN_OPEN, 1, '/dev/null', os.O_WRONLY, 0)])
        _, status, usage = os.wait4(pid, 0)
        if status:
            sys.exit(f'{arguments} ended with status {status}')
        cpu_ms.append(1e3 * (usage.ru_utime + usage.ru_stime))
        peak_mb = max(peak_mb, usage.ru_maxrss / 1024)
    return statistics.median(cpu_ms), peak_mb


def report_of_two_runs():
    """Median CPU ms and peak MB of abs_report over the paper's experiment under two controllers."""
    with tempfile.TemporaryDirectory() as scratch:
        runs = [f'{scratch}/{controller}' for controller in ('adaptive', 'sliding-mode')]
        for run in runs:
            subprocess.run([BIN / 'abs_hil', '--fast', '--no-lcm', '--controller', pathlib.Path(run).name, '--out', run],
                           check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return whole_process([str(BIN / 'abs_report'), *runs, '--output', f'{scratch}/report', '--force'])


def python_with(*modules):
    """A Python that has these modules, else None."""
    # Debian's own Python before that of the PATH: only this one finds python3-scipy.
    for python in (ROOT / 'build' / 'python' / 'bin' / 'python', '/usr/bin/python3', sys.executable):
        found = pathlib.Path(python).exists() and subprocess.run([python, '-c', f'import {", ".join(modules)}'],
                                                                 capture_output=True).returncode == 0
        if found:
            return python
    return None


def elsewhere():
    """(name, ms, error) of the same braking in other languages, if they are installed."""
    rows = []
    scripts = ROOT / 'bench' / 'baselines'
    if shutil.which('octave'):
        rows += subprocess.run(['octave', '--no-gui', '--quiet', scripts / 'braking.m'], check=True, capture_output=True,
                               text=True).stdout.splitlines()
    if python := python_with('scipy'):
        rows += subprocess.run([python, scripts / 'braking.py'], check=True, capture_output=True,
                               text=True).stdout.splitlines()
    return [(name, float(ms), float(error)) for name, ms, error in (row.split() for row in rows)]


def instructions():
    done = subprocess.run([sys.executable, ROOT / 'bench' / 'instruction_budget.py', BIN / 'bench_instruction_count'],
                          capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else None


def shown_ns(ns):
    if ns >= 1e9:
        return f'{ns / 1e9:.3g} s'
    return f'{ns / 1e6:.3g} ms' if ns >= 1e6 else f'{ns / 1e3:.3g} µs' if ns >= 1e3 else f'{ns:.3g} ns'


def shown_ratio(ratio):
    return f'{ratio:.0f}' if ratio >= 10 else f'{ratio:.2g}'


def table(head, rows):
    return '\n'.join(['| ' + ' | '.join(head) + ' |', '|' + '---|' * len(head)] +
                     ['| ' + ' | '.join(row) + ' |' for row in rows])


def machine():
    cpu = re.search(r'model name\s*:\s*(.*)', pathlib.Path('/proc/cpuinfo').read_text())
    compiler = subprocess.run(['g++', '-dumpfullversion'], capture_output=True, text=True).stdout.strip()
    system = re.search(r'PRETTY_NAME="(.*)"', pathlib.Path('/etc/os-release').read_text()).group(1)
    return (f'{os.cpu_count()} processors "{cpu.group(1) if cpu else platform.machine()}", {system}, g++ {compiler}, '
            f'load {os.getloadavg()[0]:.1f} when it began, {time.strftime("%Y-%m-%d")}')


INTEGRATION_NAMES = {
    'plant': '`plant_sim::Plant` (RK4, at most 500 µs, all of its friction, standstill and road logic)',
    'hand_written_rk4/10': 'hand-written RK4, 100 µs', 'hand_written_rk4/2': 'hand-written RK4, 500 µs',
    'hand_written_rk4/1': 'hand-written RK4, 1 ms', 'boost_rk4/10': 'Boost.odeint runge_kutta4, `std::array`, 100 µs',
    'boost_rk4/2': 'Boost.odeint runge_kutta4, 500 µs', 'boost_rk4/1': 'Boost.odeint runge_kutta4, 1 ms',
    'boost_dopri5': 'Boost.odeint dopri5, controlled, 1e-6 / 1e-8', 'octave_rk4/2': 'Octave, RK4 loop, 500 µs',
    'octave_ode45': 'Octave, ode45, 1e-6 / 1e-8', 'scipy_rk45': 'SciPy, solve_ivp RK45, 1e-6 / 1e-8'}


def page():
    where = machine()
    integration = [(name, ns / 1e6, run['error_rad_s']) for name, (ns, run) in bench('bench_integration').items()]
    integration.sort(key=lambda row: list(INTEGRATION_NAMES).index(row[0]))
    integration += elsewhere()
    ours = next(ms for name, ms, _ in integration if name == 'plant')
    cycle, telemetry, fast, compare = (bench(f'bench_{name}') for name in ('cycle', 'telemetry', 'fast_run', 'compare'))
    program = str(BIN / 'abs_hil')
    process_ms, process_mb = whole_process([program, '--backend', 'sim', '--fast', '--no-lcm', '--no-out'])
    report_ms, report_mb = report_of_two_runs()
    counted = instructions()
    text = f'''# Performance

`scripts/performance.py` runs the benchmarks of `bench/` and writes this page. Figures are CPU time, medians of
{REPETITIONS} interleaved repetitions. Absolute figures on a shared machine drift, so compare only figures of one table.

{where}.

## Integrating the plant

The test case is one braking from 170 rad/s under a constant duty, 2 s in ticks of 1 ms. The error is the largest
difference of the upper wheel's speed at any tick from RK4 at 1 µs (for Octave and SciPy: from their own finest
solution).

{table(['integrator', 'ms', 'ours is', 'error, rad/s'],
       [[INTEGRATION_NAMES[name], f'{ms:.3g}', f'{shown_ratio(ms / ours)} × as fast' if name != 'plant' else '', f'{error:.1g}']
        for name, ms, error in integration])}

## Whole runs

{table(['what', 'CPU'], [
    ["the paper's experiment in virtual time, 1 kHz, in-process", shown_ns(fast['paper_run'][0])],
    ['the same as a whole process (`--fast --no-lcm --no-out`)', f'{process_ms:.3g} ms, {process_mb:.0f} MB at most'],
    ['braking alone, nominal controller', shown_ns(fast['braking_run/nominal'][0])],
    ['braking alone, adaptive controller', shown_ns(fast['braking_run/adaptive'][0])],
    ['one run of `compare`, adaptive', shown_ns(compare['one_run/adaptive'][0])],
    ['a report of two runs, whole process', f'{report_ms:.3g} ms, {report_mb:.0f} MB at most'],
    ['`compare`, 1,000 runs on varied plants, wall clock', shown_ns(compare['thousand_runs'][1]['real_time'] * 1e6)],
])}

The acceleration costs more than the braking: near standstill the slip dynamics are stiff and the integration takes
short steps.

## The parts of a cycle

{table(['what', 'time'], [[f'`{name}`', shown_ns(ns)] for name, (ns, _) in sorted(cycle.items())])}

## The slow side, a cycle

{table(['what', 'time'], [[f'`{name}`', shown_ns(ns)] for name, (ns, _) in sorted(telemetry.items())])}

`publish_in_process` is LCM's memq. Over UDP a publish also makes system calls (not measured here). Its caller is never
the real-time thread.
'''
    if counted:
        text += f'''
## Instructions of the real-time thread

callgrind counts the instructions; the count is the same on every run. `ctest -R bench_instructions` fails if a count
exceeds its budget.

{re.sub("^", "    ", counted.strip(), flags=re.MULTILINE)}
'''
    return text


LANES = '## Many runs side by side'
SETS = ('none', 'portable', 'avx2', 'avx512')
LANES_REPETITIONS = 3


def lane_row(found, name):
    """The cells of a workload: its rates by the scalar path and in lanes, and the share of runs in lanes."""
    rates = {s: found[f'{name}/{s}'][1] for s in SETS if f'{name}/{s}' in found}
    alone = rates['none']['runs_per_s']
    share = rates.get('portable', {'in_lanes': 0})['in_lanes']
    shown = [f'{rate["runs_per_s"]:,.0f} ({rate["runs_per_s"] / alone:.1f} ×)' if (rate := rates.get(s)) else '–'
             for s in SETS[1:]]
    plant, controller = name.split('/')
    return [f'`{controller}`', re.sub(r'^(\S+)', r'`\1`', plant), f'{alone:,.0f}', *shown, f'{100 * share:.1f} %']


BARE = {'avx512': 'by hand, AVX-512, 4 vectors in flight', 'avx2': 'by hand, AVX2, 4 vectors in flight',
        'numpy': 'NumPy, RK4 over 2,000 runs at once', 'numba': 'numba, RK4 run by run',
        'scipy': "SciPy, solve_ivp RK45, 1e-6 / 1e-8"}


def bare_rows(found):
    """Rows of the plant without anything around it, from the fastest."""
    rates = {name.split('/')[-1]: run['runs_per_s'] for name, (_, run) in found.items() if name.startswith('bare/')}
    if python := python_with('numba', 'scipy') or python_with('scipy'):
        lines = subprocess.run([python, ROOT / 'bench' / 'baselines' / 'braking_many.py'], check=True, capture_output=True,
                               text=True, env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'}).stdout.splitlines()
        rates |= {line.split()[0]: float(line.split()[1]) for line in lines}
    return [[BARE[name], f'{rates[name]:,.3g}' if rates[name] < 100 else f'{rates[name]:,.0f}']
            for name in sorted(rates, key=rates.get, reverse=True)]


def lanes():
    """The section on runs in lanes of packs."""
    found = bench('bench_lanes', LANES_REPETITIONS)
    names = [name.removesuffix('/none') for name in found if name.endswith('/none')]
    names.sort(key=lambda name: (' on ' in name, not name.startswith('paper'), name))
    return f'''{LANES}

Braking runs a second of CPU time, medians of {LANES_REPETITIONS} interleaved repetitions: from 170 rad/s to 0.3 m/s at
1 kHz, with the real actuator and encoders, on plants varied as `abs_hil compare` does, set-up included. In parentheses:
against the scalar path. The last column is the share of the runs that stayed in lanes; the scalar path computed the others
again. On patches, the friction is halved in every second stretch of 2 m.

{machine()}

{table(['controller', 'plant', 'scalar', 'portable (2 lanes)', 'AVX2', 'AVX-512', 'in lanes'],
       [lane_row(found, name) for name in names])}

The limit is the bare plant: (1)-(7) with both wheels turning, without controller, encoders, checks, figures and standstill,
2 s from 170 rad/s under a constant duty in 4,000 steps of RK4. A run of the table above takes more steps than that, and does
all the rest. One core, in the same minutes:

{table(['the bare plant', 'runs a second'], bare_rows(found))}
'''


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[1])
    parser.add_argument('--output', type=pathlib.Path, default=ROOT / 'build' / 'release' / 'performance.md')
    parser.add_argument('--lanes', action='store_true', help='renew the section on many runs alone')
    arguments = parser.parse_args()
    if not (BIN / ('bench_lanes' if arguments.lanes else 'bench_integration')).exists():
        sys.exit('performance.py: no benchmarks; build them with scripts/build.sh release')
    before = arguments.output.read_text() if arguments.output.exists() else ''
    if arguments.lanes:
        begin = before.find(LANES)
        arguments.output.write_text((before[:begin] if begin >= 0 else before) + lanes())
        return
    arguments.output.write_text(page() + '\n' + lanes())


if __name__ == '__main__':
    main()
