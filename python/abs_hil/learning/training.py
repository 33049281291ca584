"""abs_learn: a small learner, from scratch: the cross-entropy method over a controller of nine numbers (docs/learning.md)."""
import argparse
import json
import pathlib
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .. import parsers
from ..files import write_text, write_whole
from ..options import as_main
from ..report import model, pictures
from .rigs import TRAINING_SEED, Rigs, Task

#: plants on which nobody trains
JUDGING_SEED = 2
#: what the learner is compared with
LAWS = ('adaptive', 'adaptive-peak')


@dataclass
class Policy:
    """Torque = squashed weighted sum of 1, slip error, its integral, both accelerations, torque, speed; the error's weights
    also with the speed. Its only state is the integral, of one number a rig."""
    weights: np.ndarray  # shape (..., 9)
    integral: np.ndarray = field(default_factory=lambda: np.zeros(1))

    SIZE = 9

    def begin(self, rigs: int) -> None:
        self.integral = np.zeros(rigs)

    def actions(self, observations: np.ndarray, period_s: float) -> np.ndarray:
        o = observations.astype(np.float64)
        error = o[:, 1] - o[:, 0]
        speed = o[:, 2] / 17.0
        features = np.stack([np.ones(len(o)), error / 0.1, self.integral / 0.03, o[:, 3] / 500.0, o[:, 4] / 50.0,
                             o[:, 5], speed, speed * error / 0.1, speed * self.integral / 0.03], axis=1)
        asked = 0.5 + np.einsum('...i,...i->...', features, self.weights)
        # The integral stands while the brake cannot give more.
        winds_up = ((asked >= 1.0) & (error > 0.0)) | ((asked <= 0.0) & (error < 0.0))
        self.integral = self.integral + np.where(winds_up, 0.0, error * period_s)
        return np.clip(asked, 0.0, 1.0)


@dataclass
class Curve:
    """Mean reward of an episode of the best half, and of the search's mean, after each generation."""
    elite: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)


def returns(rigs: Rigs, policy: Policy | None, first: int, plants: int | None = None) -> np.ndarray:
    """Sum of the rewards of one episode of every rig, on the plants first, first + 1, ...; again from first after `plants`."""
    observations = rigs.reset_all(first, plants)
    total = np.zeros(rigs.count)
    if policy is not None:
        policy.begin(rigs.count)
    ended = np.zeros(rigs.count, dtype=bool)
    while not ended.all():
        actions = np.zeros(rigs.count) if policy is None else policy.actions(observations, rigs.task.period_s)
        observations, rewards, ended = rigs.step(actions)
        total += rewards
    return total


def train(task: Task, generations: int, seed: int, *, population: int = 40, plants: int = 6, threads: int = 0,
          progress: Callable[[int, float], None] = lambda generation, reward: None) -> tuple[Policy, Curve]:
    """Draws candidates around a mean, keeps the best quarter, and moves mean and spread there. Reproducible."""
    generator = np.random.default_rng(seed)
    mean, spread = np.zeros(Policy.SIZE), np.full(Policy.SIZE, 0.5)
    curve = Curve()
    rigs = Rigs(population * plants, task, seed=TRAINING_SEED, threads=threads)
    alone = Rigs(plants, task, seed=TRAINING_SEED, threads=threads)
    for generation in range(generations):
        candidates = generator.normal(mean, spread, (population, Policy.SIZE))
        # Every candidate meets the same plants, others in each generation.
        total = returns(rigs, Policy(np.repeat(candidates, plants, axis=0)), generation * plants, plants)
        total = total.reshape(population, plants).mean(axis=1)
        order = np.argsort(-total, kind='stable')[:population // 4]
        mean = candidates[order].mean(axis=0)
        spread = candidates[order].std(axis=0) + 0.02 / (1 + generation)
        curve.elite.append(float(total[order].mean()))
        curve.mean.append(float(returns(alone, Policy(mean), 0).mean()))
        progress(generation + 1, curve.mean[-1])
    return Policy(mean), curve


def judge(task: Task, policy: Policy | None, law: str, plants: int) -> np.ndarray:
    """Returns of a policy, or of a controller of the program, on plants that training never saw; shape (plants,)."""
    return returns(Rigs(plants, task, seed=JUDGING_SEED, law=law), policy, 0)


def _draw(path: pathlib.Path, elite: list[float], mean: list[float], laws: dict[str, float]) -> None:
    generations = np.arange(1.0, len(mean) + 1.0)
    lines = {'mean of the search': mean, 'best quarter, on its own plants': elite,
             **{law: [value] * len(mean) for law, value in laws.items()}}
    curves = [model.Curve(0, name, model.run_style(number), generations, np.array(values), legend=name)
              for number, (name, values) in enumerate(lines.items())]
    lowest = max(min(mean), 4.0 * min(laws.values(), default=-1.0))
    panel = model.Panel(model.Label.plain('reward of an episode'), curves, (lowest, 0.0), height_px=280.0)
    figure = model.Figure('learning', 'Learning curve', model.Label.plain('generation'), [panel])
    pictures.save(figure, path, path.suffix.removeprefix('.') or 'png')


@as_main(parsers.learn)
def main(o: argparse.Namespace) -> None:
    if o.figure and o.figure.suffix not in ('', '.svg', '.pdf', '.png'):
        raise ValueError(f'--figure {o.figure}: give a file .svg, .pdf or .png')
    for path in filter(None, (o.output, o.figure)):  # no training for a result that would be lost
        write_whole(path, lambda name: None, probe=True)
    if o.figure:
        import matplotlib.figure  # noqa: F401
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
