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

# (description, functions, budget in instructions per cycle, and the controller if it is not adaptive, and its dead time)
BUDGETS = [
    # 1,000 until late samples had to be plausible (some 60) and the controller reported its states and V (some 85).
    ('observers, adaptive controller, gate',
     ['abs_hil::control::TrackingObserver::update*',
      'abs_hil::control::LawController<abs_hil::control::AdaptiveLaw>::step*',
      'abs_hil::runtime::CommandGate::check(*'], 1150),
    # 1,500 until the sequence took conditions from experiment files and controllers could be adjusted live (some 40);
    # 1,550 until the brake map was inverted onto the PWM's steps, the controller's output checked for finiteness, gate
    # and integrals told what was sent (some 200), stamps had an uncertainty and conditions needed two samples (some
    # 120); 1,960 until the controller's own signals had to be finite (some 30); 1,990 until phases could ask and part
    # the wheels (some 10).
    ('the same with sequence and actuator: all of "control"', ['counted_control', 'counted_sent'], 2000),
    # These two together cost 389 until the checks judged the uncertainty of the stamps and told when they could not.
    # They may grow by 15 % over that, to 447, and by 9 for the overspeed that the counts alone show.
    ('plausibility of the measurement', ['counted_watch'], 315),
    ('gate: check of the command', ['abs_hil::runtime::CommandGate::check(*'], 141),
    ("heartbeat, check of the guardian's, flight recorder", ['counted_watchers'], 430),
    ('ring push of one record', ['counted_ring_push'], 150),
    ('five histograms', ['counted_statistics'], 200),
    # A bank of 24 curves; nearly the same number of operations in each cycle.
    ('adaptive-optimal', ['abs_hil::control::LawController<abs_hil::control::AdaptiveOptimalLaw>::step*'], 6000,
     'adaptive-optimal'),
    # Four parts of 6 ms, and the force where they end.
    ('adaptive-optimal behind a dead time of 24 ms',
     ['abs_hil::control::LawController<abs_hil::control::AdaptiveOptimalLaw>::step*'], 12600, 'adaptive-optimal', '0.024'),
    ('adaptive-predictor behind 24 ms',
     ['abs_hil::control::LawController<abs_hil::control::AdaptivePredictorLaw>::step*'], 3500, 'adaptive-predictor', '0.024'),
]


def count(program, functions, arguments):
    """Instructions of all calls of the functions, including their callees, and the number of cycles of the run."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / 'callgrind.out'
        toggles = [f'--toggle-collect={function}' for function in functions]
        run = subprocess.run(['valgrind', '--tool=callgrind', *toggles, f'--callgrind-out-file={out}', program,
                              *arguments],
                             capture_output=True, text=True)
        if run.returncode:
            sys.exit(f'{program} under callgrind ended with status {run.returncode}:\n{run.stderr}')
        text = out.read_text()
        called = [f for f in functions if re.search(r'fn=.*' + re.escape(f.rstrip('*')), text)]
        if called != functions:
            sys.exit(f'never called, or not by that name: {set(functions) - set(called)}')
        return int(re.search(r'^(?:totals|summary):\s*(\d+)', text, re.MULTILINE).group(1)), int(run.stdout)


def main():
    if not shutil.which('valgrind'):
        print('SKIPPED: valgrind is not installed')
        return 77
    over = False
    for what, functions, budget, *arguments in BUDGETS:
        total, cycles = count(sys.argv[1], functions, arguments or ['adaptive'])
        per_cycle = total / cycles
        exceeded = not 0 < per_cycle <= budget
        over = over or exceeded
        print(f'{what:<54} {per_cycle:8.1f} of {budget} instructions a cycle{" EXCEEDED" if exceeded else ""}')
    return 1 if over else 0


if __name__ == '__main__':
    sys.exit(main())
