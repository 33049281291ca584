"""The command line of abs_learn."""
import argparse
import json
import pathlib
import sys
from functools import partial

import numpy as np

from ..core import _core
from ..files import write_text, write_whole
from .rigs import Task
from .training import Policy, judge, train

LAWS = ('adaptive', 'adaptive-peak')


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser('abs_learn', allow_abbrev=False, description='Trains a small controller in simulation by '
                                   'trial and error, and compares it with laws of the program (docs/learning.md)')
    made.add_argument('--plant', metavar='NAME|FILE', default='paper-timing', help='nominal plant [paper-timing]')
    made.add_argument('--vary', metavar='SPEC', default=Task.vary, help=f'what varies between episodes [{Task.vary}]')
    made.add_argument('--generations', metavar='N', type=int, default=60, help='generations of the search [60]')
    made.add_argument('--seed', metavar='N', type=int, default=1, help='seed of the search [1]')
    made.add_argument('--judge', metavar='N', type=int, default=100, help='plants on which the result is judged [100]')
    made.add_argument('--output', metavar='FILE', type=pathlib.Path, help='write the weights and the curve as JSON')
    made.add_argument('--figure', metavar='FILE', type=pathlib.Path, help='draw the learning curve (SVG, PDF or PNG)')
    made.add_argument('--version', action='version', version=_core.version)
    return made


def _draw(path: pathlib.Path, elite: list[float], mean: list[float], laws: dict[str, float]) -> None:
    from matplotlib.figure import Figure
    picture = Figure(figsize=(7.2, 3.4), layout='constrained')
    axes = picture.subplots()
    generations = np.arange(1, len(mean) + 1)
    axes.plot(generations, mean, color='#0072B2', label='mean of the search')
    axes.plot(generations, elite, color='#56B4E9', linestyle=':', label='best quarter, on its own plants')
    for (law, value), colour, dash in zip(laws.items(), ('#D55E00', '#009E73'), ('--', '-.')):
        axes.axhline(value, color=colour, linestyle=dash, label=law)
    axes.set_xlabel('generation')
    axes.set_ylabel('reward of an episode')
    axes.set_ylim(max(min(mean), 4.0 * min(laws.values(), default=-1.0)), 0.0)
    axes.grid(color='#e4e4e4')
    axes.legend(fontsize=8)
    kind = path.suffix.removeprefix('.') or 'png'
    write_whole(path, partial(picture.savefig, format=kind, metadata={'Date': None} if kind == 'svg' else None))


def main(arguments: list[str]) -> int:
    o = parser().parse_args(arguments)
    try:
        if min(o.generations, o.judge) < 1 or o.seed < 0:
            raise ValueError('--generations, --judge: give numbers of at least 1; --seed: of at least 0')
        task = Task(plant=o.plant, vary=o.vary)

        def progress(generation: int, reward: float) -> None:
            print(f'generation {generation} of {o.generations}, reward {reward:.3f}', file=sys.stderr)

        policy, curve = train(task, o.generations, o.seed, progress=progress)
        rewards = {'learned': judge(task, Policy(policy.weights), '', o.judge)}
        rewards.update({law: judge(task, None, law, o.judge) for law in LAWS})
        print(f'{"reward on " + str(o.judge) + " plants":<24}  {"mean":>8}  {"median":>8}  {"worst":>8}')
        for name, values in rewards.items():
            print(f'{name:<24}  {values.mean():8.3f}  {np.median(values):8.3f}  {values.min():8.3f}')
        if o.output:
            data = {'weights': policy.weights.tolist(), 'curve': curve.mean, 'elite': curve.elite,
                    'rewards': {name: values.tolist() for name, values in rewards.items()}}
            write_text(o.output, json.dumps(data, indent=1) + '\n')
        if o.figure:
            _draw(o.figure, curve.elite, curve.mean, {law: float(rewards[law].mean()) for law in LAWS})
    except (ValueError, OSError) as error:
        print(f'abs_learn: {error}', file=sys.stderr)
        return 2
    return 0
