"""The learning environments: gymnasium's own checker, the same bits for the same seed, rewards as stated."""
import copy
import importlib
import pickle
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import abs_hil
from abs_hil import programs
from abs_hil.learning import ID, Rigs, Task, training
from abs_hil.learning.rigs import FAULT_REWARD
from abs_hil.learning.training import Policy, judge, returns, train

QUICK = {'start_speed_rad_s': 60.0}
STANDARD = Task(plant='paper-table1', vary='none', start_speed_rad_s=170.0)


def test_gymnasiums_checker():
    environment = gymnasium.make(ID, **QUICK)
    check_env(environment.unwrapped, skip_render_check=True)


def test_the_picture_shows_the_episode():
    environment = gymnasium.make(ID, render_mode='rgb_array', **QUICK)
    check_env(environment.unwrapped)
    plain = gymnasium.make(ID, **QUICK).unwrapped

    def picture(actions):
        environment.reset(seed=1)
        for action in actions:
            environment.step(np.array([action], dtype=np.float32))
        return environment.render()
    first = picture([0.5] * 20)
    assert first.shape == (480, 640, 3) and first.dtype == np.uint8
    np.testing.assert_array_equal(first, picture([0.5] * 20))
    np.testing.assert_array_equal(first, copy.deepcopy(environment.unwrapped).render())
    assert not np.array_equal(first, picture([0.5] * 10 + [0.6] * 10))
    assert plain.render() is None
    with pytest.raises(ValueError, match="render_mode 'human'"):
        type(plain)(render_mode='human')


def test_the_same_seed_gives_the_same_episode():
    def episode(seed):
        environment = gymnasium.make(ID, **QUICK)
        observation, _ = environment.reset(seed=seed)
        rows, over = [observation], False
        while not over:
            observation, reward, terminated, truncated, _ = environment.step(np.array([0.5], dtype=np.float32))
            rows.append(np.append(observation, np.float32(reward)))
            over = terminated or truncated
        return np.concatenate(rows)
    np.testing.assert_array_equal(episode(1), episode(1))
    assert not np.array_equal(episode(1), episode(2))


def test_a_law_in_the_environment_is_the_law_in_the_simulator():
    """Every tenth cycle of the same run: the environment's slip is that of simulate, bit for bit."""
    run = abs_hil.simulate('adaptive', set={'experiment.start_speed_rad_s': 170})
    brake = run.during('brake')
    rigs = Rigs(1, STANDARD, law='adaptive')
    rigs.reset(0, 0)
    seen = []
    for _ in range(150):
        rigs.step(np.zeros(1))
        seen.append(rigs.true_slip[0])
    np.testing.assert_array_equal(seen, brake['slip'][10:10 + 1500:10])


def test_reward_is_as_stated():
    rigs = Rigs(2, STANDARD)
    rigs.reset_all()
    before = np.zeros(2)
    for actions in (np.array([0.4, 0.9]), np.array([0.6, 0.9]), np.array([0.6, 0.1])):
        _, rewards, _ = rigs.step(actions)
        np.testing.assert_allclose(rewards, -np.abs(rigs.true_slip - 0.15) - 0.1 * np.abs(actions - before), rtol=1e-12)
        before = actions
    observation = rigs.observations()
    assert observation.shape == (2, 7) and observation.dtype == np.float32
    assert observation[:, 1] == pytest.approx([0.15, 0.15])


def test_no_braking_costs_as_much_as_a_fault():
    chatter = Rigs(1, STANDARD)
    chatter.reset(0, 0)
    total, ended, n = 0.0, False, 0
    while not ended:
        _, rewards, over = chatter.step(np.array([float(n % 2)]))
        total, ended, n = total + rewards[0], bool(over[0]), n + 1
    assert FAULT_REWARD < total < -0.1 * (n - 1)
    faulty = Rigs(1, Task(set={'gate.overspeed_rad_s': 100.0}))
    faulty.reset(0, 0)
    rewards, steps = [], 0
    ended = False
    while not ended and steps < 100:
        _, reward, over = faulty.step(np.array([0.3]))
        rewards.append(reward[0])
        ended, steps = bool(over[0]), steps + 1
    assert FAULT_REWARD in rewards


def test_full_brake_locks_and_no_brake_rolls():
    rigs = Rigs(2, STANDARD)
    rigs.reset_all()
    for _ in range(60):
        rigs.step(np.array([1.0, 0.0]))
    assert rigs.true_slip[0] == pytest.approx(1.0) and abs(rigs.true_slip[1]) < 0.02


def test_threads_and_neighbours_change_nothing():
    alone = Rigs(1, Task(), threads=1)
    alone.reset(0, 5)
    many = Rigs(6, Task(), threads=3)
    many.reset_all()
    for step in range(40):
        action = 0.3 + 0.01 * step
        one, _, _ = alone.step(np.array([action]))
        six, _, _ = many.step(np.full(6, action))
        np.testing.assert_array_equal(one[0], six[5])


def test_vector_environment():
    environment = gymnasium.make_vec(ID, num_envs=3, vectorization_mode='vector_entry_point', **QUICK)
    chosen, info = environment.reset(options={'index': [5, 6, 5]})
    assert info['index'].tolist() == [5, 6, 5]
    np.testing.assert_array_equal(chosen[0], chosen[2])
    observations, info = environment.reset(seed=3)
    assert observations.shape == (3, 7) and info['true_slip'].shape == info['_index'].shape == (3,)
    ended = np.zeros(3, dtype=int)
    for _ in range(400):
        observations, rewards, terminated, truncated, _ = environment.step(np.full((3, 1), 0.6, dtype=np.float32))
        assert environment.observation_space.contains(observations)
        ended += terminated | truncated
    assert (ended >= 1).all(), 'each rig began again'


def test_a_gymnasium_that_is_too_old_is_named_with_what_to_install(monkeypatch):
    monkeypatch.delattr(gymnasium.vector, 'AutoresetMode')  # as before 1.1
    monkeypatch.delitem(sys.modules, 'abs_hil.learning.environment', raising=False)
    with pytest.raises(ImportError, match=r"is too old.*(pip install 'gymnasium>=1\.1'|python-packages-tests\.txt)"):
        importlib.import_module('abs_hil.learning.environment')


def test_an_option_that_no_environment_has_is_refused():
    vectors = gymnasium.make_vec(ID, num_envs=2, vectorization_mode='vector_entry_point', **QUICK)
    for environment in (gymnasium.make(ID, **QUICK), vectors):
        with pytest.raises(ValueError, match="has no option 'plant.theta_N'; its options: index"):
            environment.reset(options={'plant.theta_N': 30})


def test_randomised_plants_differ_and_bad_tasks_are_refused():
    rigs = Rigs(1, Task(vary='none', randomise={'plant.theta_N': (15.0, 30.0)}))
    slips = []
    for index in (1, 2, 1):
        rigs.reset(0, index)
        for _ in range(20):
            rigs.step(np.array([0.6]))
        slips.append(rigs.true_slip[0])
    assert slips[0] == slips[2] != slips[1]
    with pytest.raises(ValueError, match='period_s'):
        Rigs(1, Task(period_s=1e-6))
    with pytest.raises(ValueError, match='nearest'):
        Rigs(1, Task(plant='paper-tabel1')).reset(0, 0)
    with pytest.raises(ValueError, match='reset'):
        Rigs(1).step(np.zeros(1))
    rigs.reset(0, 0)
    with pytest.raises(ValueError, match='actions'):
        rigs.step(np.array([np.nan]))


def test_training_improves_and_repeats():
    task = Task(plant='paper-timing', start_speed_rad_s=100.0)
    policy, curve = train(task, 3, 1, population=12, plants=2)
    again, _ = train(task, 3, 1, population=12, plants=2, threads=1)
    np.testing.assert_array_equal(policy.weights, again.weights)
    assert len(curve.mean) == 3
    start = returns(Rigs(4, task, seed=9), Policy(np.zeros(Policy.SIZE)), 0).mean()
    assert returns(Rigs(4, task, seed=9), policy, 0).mean() > start
    assert judge(task, None, 'adaptive', 3).shape == (3,)


@pytest.mark.parametrize('given', [['--output', 'none/l.json'], ['--output', '.'], ['--figure', 'none/f.svg'],
                                   ['--figure', 'f.foo'], ['--generations', '0'], ['--seed', '-1']])
def test_what_cannot_be_written_is_refused_before_the_training(given, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(training, 'train', lambda *_, **__: pytest.fail('it trains'))
    assert programs.start('learn', given) == 2
    assert given[1] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_environments_branch():
    """A copy in the middle of an episode goes on as its original does, a vector's too, in which episodes began at other times."""
    env = gymnasium.make(ID).unwrapped
    env.reset(seed=3)
    for n in range(40):
        env.step(np.array([0.3 + 0.01 * (n % 20)], dtype=np.float32))
    branches = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    other = copy.deepcopy(env)
    other.step(np.array([1.0], dtype=np.float32))

    def go_on(one):
        steps = [one.step(np.array([0.5], dtype=np.float32)) for _ in range(30)]
        return repr([(step[0].tolist(), *step[1:]) for step in steps] + [one.reset()[1]])

    expected = go_on(env)
    assert [go_on(branch) for branch in branches] == [expected] * 2
    assert go_on(other) != expected

    rigs = Rigs(3, seed=5)
    rigs.reset_all()
    generator = np.random.default_rng(1)
    for n in range(60):
        if n in (20, 45):
            rigs.reset(n % 3, 10 + n)
        rigs.step(generator.uniform(0.0, 0.6, 3))
    branch = copy.deepcopy(rigs)
    for _ in range(20):
        actions = generator.uniform(0.0, 0.6, 3)
        for ours, theirs in zip(rigs.step(actions), branch.step(actions)):
            np.testing.assert_array_equal(ours, theirs)
