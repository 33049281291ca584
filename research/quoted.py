#!/usr/bin/env python3
"""usage: quoted.py braking|mismatch|benchmark

Prints the sentences of docs/theory-beyond.md and docs/benchmark.md that quote the tables of docs/reference, with the numbers
that the tables have now: those of braking.csv, of braking-mismatch.csv, of benchmark.csv.
"""
import csv
import pathlib
import sys

REFERENCE = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'reference'


def rows(name, **wanted):
    with open(REFERENCE / f'{name}.csv', encoding='utf-8', newline='') as file:
        return [row for row in csv.DictReader(file) if all(row[key] == value for key, value in wanted.items())]


def numbers(chosen, column):
    return [float(row[column]) for row in chosen]


def mean(chosen, column):
    return sum(numbers(chosen, column)) / len(chosen)


def braking():
    own, fast, peak = (rows('braking', controller=name)
                       for name in ('adaptive-optimal', 'adaptive-optimal at 5 kHz', 'adaptive-peak'))
    worst = [max(numbers(chosen, 'excess_worst_percent')) for chosen in (own, fast, peak)]
    means = [mean(chosen, 'excess_mean_percent') for chosen in (own, fast, peak)]
    varied = [mean(chosen, 'torque_variation_mean_Nm') for chosen in (own, fast, peak)]
    most_Nm = max(numbers(own, 'torque_variation_worst_Nm'))
    lever = numbers([row for row in own if row['plant'] == 'inteco-manual'], 'excess_mean_percent')
    timing = [row for row in own if row['plant'] == 'paper-timing' and row['road'] == 'patches']
    patches = mean(timing, 'excess_mean_percent')
    return [f'it brakes {means[0]:.1f} % longer than the bound in the mean and {worst[0]:.1f} % at worst, with a torque variation '
            f'of {varied[0]:.0f} N m (worst {most_Nm:.0f}); at 5 kHz {means[1]:.1f} and {worst[1]:.1f} %, {varied[1]:.0f} N m. '
            f'`adaptive-peak`: {means[2]:.1f} and {worst[2]:.1f} %, {varied[2]:.0f} N m.',
            f'`inteco-manual` ({min(lever):.1f} to {max(lever):.1f} % on each road) and on the patches of `paper-timing` '
            f'({patches:.1f} %)']


def mismatch():
    own, peak = (rows('braking-mismatch', controller=name) for name in ('adaptive-optimal', 'adaptive-peak'))
    means, worst = (numbers(own, f'excess_{what}_percent') for what in ('mean', 'worst'))
    theirs, most = numbers(peak, 'excess_mean_percent'), max(peak, key=lambda row: float(row['excess_worst_percent']))
    return [f'the mean stays between {min(means):.1f} and {max(means):.1f} % above the bound of the plant as it is, the worst '
            f'case between {min(worst):.1f} and {max(worst):.1f} %; `adaptive-peak`: {min(theirs):.1f} to {max(theirs):.1f} %, '
            f'worst {most["excess_worst_percent"]} % with a {most["wrong"].replace("lag ", "lag of ")}']


def benchmark():
    both, cap = (min((row for row in rows('benchmark', group=group) if not row['controller'].endswith(', warm')),
                     key=lambda row: float(row['excess mean %'])) for group in ('combined', 'capped'))
    return [f'With several things wrong at once `{both["controller"]}` leads, with a mean of {both["excess mean %"]} % and a '
            f'worst case of {both["worst %"]} %. With the boards\' cap of the brake `{cap["controller"]}` leads '
            f'({cap["excess mean %"]} %, {cap["worst %"]} %)']


def main():
    quoting = {'braking': braking, 'mismatch': mismatch, 'benchmark': benchmark}
    if len(sys.argv) != 2 or sys.argv[1] not in quoting:
        print(__doc__, file=sys.stderr)
        return 2
    print('\n'.join(quoting[sys.argv[1]]()))
    return 0


if __name__ == '__main__':
    sys.exit(main())
