#!/usr/bin/env python3
"""usage: performance.py [--output FILE] [--lanes]

Runs the benchmarks of build/release, and the same braking in Octave and SciPy if they are installed. Writes
docs/performance.md. Each figure is the median of repetitions. The repetitions of one program's benchmarks are
interleaved. --lanes renews the section on many runs alone.
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


def bench(program):
    """{name: (median CPU ns, counters)} of a benchmark program."""
    with tempfile.NamedTemporaryFile(suffix='.json') as out:
        subprocess.run([BIN / program, f'--benchmark_repetitions={REPETITIONS}', '--benchmark_enable_random_interleaving=true',
                        '--benchmark_min_time=0.02', f'--benchmark_out={out.name}', '--benchmark_out_format=json'],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        runs = json.load(open(out.name))['benchmarks']
    unit = {'ns': 1.0, 'us': 1e3, 'ms': 1e6}
    found = {}
    for run in runs:
        if run['run_type'] == 'aggregate' and run['aggregate_name'] == 'median':
            name = re.sub(r'/iterations:\d+|/real_time|_median$', '', run['name'])
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


def elsewhere():
    """(name, ms, error) of the same braking in other languages, if they are installed."""
    rows = []
    scripts = ROOT / 'bench' / 'baselines'
    if shutil.which('octave'):
        rows += subprocess.run(['octave', '--no-gui', '--quiet', scripts / 'braking.m'], check=True, capture_output=True,
                               text=True).stdout.splitlines()
    # Debian's own Python first: only this one finds python3-scipy.
    for python in ('/usr/bin/python3', sys.executable):
        if subprocess.run([python, '-c', 'import scipy'], capture_output=True).returncode == 0:
            rows += subprocess.run([python, scripts / 'braking.py'], check=True, capture_output=True,
                                   text=True).stdout.splitlines()
            break
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


def lanes():
    """The section on runs in lanes of packs."""
    found = bench('bench_lanes')
    rows = []
    for name in sorted(found, key=lambda name: name.split('/')[0], reverse=True):
        plant, controller, which = name.split('/')
        if which != 'none':
            continue
        rates = {s: found[f'{plant}/{controller}/{s}'] for s in SETS if f'{plant}/{controller}/{s}' in found}
        alone = rates['none'][1]['runs_per_s']
        shown = [f'{rate[1]["runs_per_s"]:,.0f} ({rate[1]["runs_per_s"] / alone:.1f} ×)' if (rate := rates.get(s)) else '–'
                 for s in SETS[1:]]
        rows.append([f'`{controller}`', f'`{plant}`', f'{alone:,.0f}', *shown, f'{100 * rates["portable"][1]["in_lanes"]:.1f} %'])
    return f'''{LANES}

Braking runs a second on one core, by CPU time, medians of {REPETITIONS}: from 170 rad/s to 0.3 m/s at 1 kHz, with the
real actuator and encoders, on plants varied as `abs_hil compare` does, set-up included. In parentheses: against the scalar
path. The last column is the share of the runs that stayed in lanes; the scalar path computed the others again.

{machine()}

{table(['controller', 'plant', 'scalar', 'portable (2 lanes)', 'AVX2', 'AVX-512', 'in lanes'], rows)}
'''


def build_cost(page):
    """The section that scripts/build_cost.py writes, from the page as it is."""
    begin = page.find('## Building the programs')
    return page[begin:] if begin >= 0 else ''


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[1])
    parser.add_argument('--output', type=pathlib.Path, default=ROOT / 'docs' / 'performance.md')
    parser.add_argument('--lanes', action='store_true', help='renew the section on many runs alone')
    arguments = parser.parse_args()
    if not (BIN / 'bench_integration').exists():
        sys.exit('performance.py: no benchmarks; build them with scripts/build.sh release')
    before = arguments.output.read_text() if arguments.output.exists() else ''
    if arguments.lanes:
        begin = before.find(LANES)
        head = before[:begin if begin >= 0 else before.find('## Building the programs')]
        arguments.output.write_text(head + lanes() + '\n' + build_cost(before))
        return
    arguments.output.write_text(page() + '\n' + lanes() + '\n' + build_cost(before))


if __name__ == '__main__':
    main()
