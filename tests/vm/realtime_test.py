#!/usr/bin/env python3
"""usage: realtime_test.py ABS_HIL

Runs the cycle on the PREEMPT_RT kernel in virtual time, where the clock counts the guest's instructions and a figure
repeats itself on any host: no tick may be missed, and the worst wake-up may exceed cyclictest's in the same guest by
15 % at most. Judges scheduling and code path, not hardware. Status 77: skipped, see vm_run.sh.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
MOST_TIMES_CYCLICTEST = 1.15
CYCLES = 20_000
# name -> whether the wake-up is judged against cyclictest, as well as the missed ticks
CASES = {'idle_1kHz': True, 'loaded_1kHz': True, 'idle_5kHz': False, 'loaded_5kHz': False}


def cyclictest_max_us(text):
    return int(re.search(r'Max:\s*(\d+)', text).group(1))


def together(runs):
    """Several runs as one: counts added, the worst of each figure."""
    def worst(part):
        return {figure: max(run[part][figure] for run in runs) for figure in ('p50', 'p99', 'p99_9', 'max')}
    whole = {count: sum(run[count] for run in runs)
             for count in ('cycles', 'ticks_missed', 'overruns', 'overruns_startup')}
    whole['realtime'] = all(run['realtime'] for run in runs)
    whole['overruns_by_cause'] = [run['overruns_by_cause'] for run in runs if run['overruns']]
    return {**whole, 'wakeup_latency_us': worst('wakeup_latency_us'), 'cycle_time_us': worst('cycle_time_us')}


def problems_of(name, compared, run, cyclictest_us):
    found = []
    if not run['realtime']:
        found.append(f'{name}: not in real time')
    if run['cycles'] < CYCLES:
        found.append(f'{name}: only {run["cycles"]} cycles')
    if run['ticks_missed'] or run['overruns'] or run['overruns_startup']:
        found.append(f'{name}: {run["ticks_missed"]} ticks missed, by cause {run["overruns_by_cause"]}, '
                     f'{run["overruns_startup"]} late cycles at the start')
    worst_us = run['wakeup_latency_us']['max']
    if compared and worst_us > MOST_TIMES_CYCLICTEST * cyclictest_us:
        found.append(f'{name}: worst wake-up {worst_us:.1f} us, cyclictest {cyclictest_us} us')
    return found


def self_test(run, cyclictest_us):
    """A judge that finds nothing wrong with planted offences would be worth nothing."""
    planted = [{'ticks_missed': 1}, {'realtime': False}, {'cycles': CYCLES - 1}, {'overruns_startup': 1},
               {'wakeup_latency_us': {'max': 1.16 * cyclictest_us}}]
    return [f'planted offence not found: {offence}' for offence in planted
            if not problems_of('planted', True, {**run, **offence}, cyclictest_us)]


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(dir=program.parent) as out:
        vm = subprocess.run([HERE / 'vm_run.sh', '-V', '-t', '500', '-o', out, '--',
                             f'bash {HERE}/realtime_guest.sh {program}'], text=True)
        if vm.returncode:
            print(f'the virtual machine ended with status {vm.returncode}')
            return vm.returncode
        problems = []
        print('              cycles  missed   cyclictest max   wake-up p50   p99  p99.9    max   cycle max (us)')
        for name, compared in CASES.items():
            run = together([json.loads(file.read_text()) for file in pathlib.Path(out).glob(f'{name}.*.json')])
            cyclictest_us = max(cyclictest_max_us(file.read_text())
                                for file in pathlib.Path(out).glob(f'{name}.*.cyclictest'))
            wakeup = run['wakeup_latency_us']
            print(f'{name:<12} {run["cycles"]:>7} {run["ticks_missed"]:>7} {cyclictest_us:>16} {wakeup["p50"]:>13.0f} '
                  f'{wakeup["p99"]:>5.0f} {wakeup["p99_9"]:>6.0f} {wakeup["max"]:>6.1f} '
                  f'{run["cycle_time_us"]["max"]:>11.1f}')
            problems += problems_of(name, compared, run, cyclictest_us)
        problems += self_test(run, cyclictest_us)
    print('\n'.join(problems) or 'no tick missed')
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
