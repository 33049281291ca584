"""A small learner, from scratch: the cross-entropy method over a controller of nine numbers."""
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .rigs import TRAINING_SEED, Rigs, Task

#: plants on which nobody trains
JUDGING_SEED = 2


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


def returns(rigs: Rigs, policy: Policy | None, first: int) -> np.ndarray:
    """Sum of the rewards of one episode of every rig, on the plants first, first + 1, ..."""
    observations = rigs.reset_all(first)
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
    elite_size = population // 4
    rigs = Rigs(population * plants, task, seed=TRAINING_SEED, threads=threads)
    alone = Rigs(plants, task, seed=TRAINING_SEED, threads=threads)
    for generation in range(generations):
        candidates = generator.normal(mean, spread, (population, Policy.SIZE))
        # Every candidate meets the same plants, others in each generation.
        total = _common(rigs, candidates, plants, generation * plants)
        order = np.argsort(-total, kind='stable')[:elite_size]
        mean = candidates[order].mean(axis=0)
        spread = candidates[order].std(axis=0) + 0.02 / (1 + generation)
        curve.elite.append(float(total[order].mean()))
        curve.mean.append(float(returns(alone, Policy(mean), 0).mean()))
        progress(generation + 1, curve.mean[-1])
    return Policy(mean), curve


def _common(rigs: Rigs, candidates: np.ndarray, plants: int, first: int) -> np.ndarray:
    """Mean return of each candidate over the same plants."""
    policy = Policy(np.repeat(candidates, plants, axis=0))
    policy.begin(rigs.count)
    for rig in range(rigs.count):
        rigs.reset(rig, first + rig % plants)
    observations = rigs.observations()
    total = np.zeros(rigs.count)
    ended = np.zeros(rigs.count, dtype=bool)
    while not ended.all():
        observations, rewards, ended = rigs.step(policy.actions(observations, rigs.task.period_s))
        total += rewards
    return total.reshape(len(candidates), plants).mean(axis=1)


def judge(task: Task, policy: Policy | None, law: str, plants: int, threads: int = 0) -> np.ndarray:
    """Returns of a policy, or of a controller of the program, on plants that training never saw; shape (plants,)."""
    return returns(Rigs(plants, task, seed=JUDGING_SEED, law=law, threads=threads), policy, 0)
