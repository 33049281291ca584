"""Controllers in Python run through the program's own cycle; plant and laws can be stepped by hand."""
import copy
import inspect
import math
import pathlib
import pickle
import signal
import subprocess
import sys

import numpy as np
import pytest
from conftest import ABS_HIL, QUICK

import abs_hil
from abs_hil.interchange.host import made


class Pi:
    """The controller `pi` (src/control/pi_controller.cpp), written again in Python."""

    def __init__(self, **options):
        value = {name.rpartition('.')[2]: row['value'] for name, row in abs_hil.keys(**options).items()
                 if name.startswith(('control.pi.', 'plant.'))}
        self.w = value
        rate = abs_hil.keys(**options)['control.rate_Hz']['value']
        self.kp = -math.expm1(-value['kp_per_s'] / rate) * rate

    def error(self, i):
        return (1.0 - i.slip_ref) * self.w['r2_m'] * i.omega2_rad_s - self.w['r1_m'] * i.omega1_rad_s

    def reset(self, i):
        self.integral = 0.0
        self.last = self.error(i)
        self.last_ref = i.slip_ref

    def step(self, i):
        w = self.w
        error = self.error(i)
        v_x = w['r2_m'] * i.omega2_rad_s
        mean = 0.5 * (self.last + (error + (i.slip_ref - self.last_ref) * v_x))
        self.last, self.last_ref = error, i.slip_ref
        self.integral += 0.0 if i.unsent_torque_Nm * mean < 0.0 else mean * i.dt_s
        feedback = -self.kp * error - w['ki_per_s2'] * self.integral
        force = max(0.0, -(w['J2_kg_m2'] * i.alpha2_rad_s2 + w['d2_Nms_rad'] * i.omega2_rad_s + w['M20_Nm']) / w['r2_m'])
        torque = w['feed_forward'] * self.equivalent(i, force) + w['J1_kg_m2'] / w['r1_m'] * feedback
        return abs_hil.SlipOutput(torque, slip_velocity_error_m_s=error)

    def equivalent(self, i, force):
        w = self.w
        gain = w['r1_m'] * w['r1_m'] / w['J1_kg_m2'] + (1.0 - i.slip_ref) * w['r2_m'] * w['r2_m'] / w['J2_kg_m2']
        drift = (-w['r1_m'] / w['J1_kg_m2'] * (w['d1_Nms_rad'] * i.omega1_rad_s + w['M10_Nm'])
                 + (1.0 - i.slip_ref) * w['r2_m'] / w['J2_kg_m2'] * (w['d2_Nms_rad'] * i.omega2_rad_s + w['M20_Nm']))
        return w['J1_kg_m2'] / w['r1_m'] * (gain * force + drift)


def same(a, b):
    assert a.columns.keys() == b.columns.keys()
    for name, values in a.columns.items():
        if name in ('phase', 'phase_name'):
            assert values.tolist() == b[name].tolist()
        else:
            assert values.tobytes() == b[name].tobytes(), name


class Delegate:
    """A controller of the program behind Python."""

    def __init__(self, name):
        self.law = abs_hil.Controller(name)
        self.signals = self.law.signals
        self.reset = self.law.reset
        self.step = self.law.step


@pytest.mark.parametrize('name', ['pi', 'adaptive', 'five-phase'])
def test_a_law_behind_python_is_the_law(name):
    ours = abs_hil.simulate(Delegate(name), set=QUICK)
    same(ours, abs_hil.simulate(name, set=QUICK))
    assert ours.summary['controller'] == 'python'


def test_the_same_law_written_in_python_gives_the_same_bits():
    same(abs_hil.simulate(Pi(set=QUICK), set=QUICK), abs_hil.simulate('pi', set=QUICK))


def test_torque_alone_will_do_and_the_gate_stands_behind_it():
    class Full:
        def reset(self, input):
            self.inputs = [input.slip_ref]

        def step(self, input):
            return 1e9

    run = abs_hil.simulate(Full(), set=QUICK)
    assert run.summary['result'] == 'completed'
    assert run['brake_pwm'].max() <= 1.0
    assert np.nanmax(run['slip']) == pytest.approx(1.0)


@pytest.mark.parametrize('where', ['reset', 'step', 'late', 'type', 'exit'])
def test_an_exception_ends_the_run_and_is_raised(where):
    class Broken:
        steps = 0

        def reset(self, input):
            if where == 'reset':
                raise RuntimeError('my reset')

        def step(self, input):
            self.steps += 1
            if where == 'type':
                return 'much'
            if where == 'exit':
                sys.exit(0)
            if where == 'step' or self.steps > 100:
                raise RuntimeError('my step')
            return 2.0

    law = Broken()
    words = {'type': "step returned 'much'; give", 'exit': 'asked Python to exit'}.get(where, 'my')
    with pytest.raises((RuntimeError, TypeError), match=words):
        abs_hil.simulate(law, set=QUICK)
    assert law.steps <= 101, 'not called again after its exception'
    assert abs_hil.simulate('pi', set=QUICK).summary['result'] == 'completed', 'nothing of it is left'


def test_a_controller_may_simulate_too():
    class Planner:
        def reset(self, input):
            self.torque_Nm = 4.0 + abs_hil.simulate(Full(), set={**QUICK, 'plant.theta_N': 30}).summary['time_locked_s']

        def step(self, input):
            return self.torque_Nm

    class Full:
        def reset(self, input):
            pass

        def step(self, input):
            return input.max_brake_torque_Nm

    run = abs_hil.simulate(Planner(), set=QUICK)
    assert run.summary['result'] == 'completed'
    assert run.during('brake')['brake_torque_ref_Nm'].max() > 4.0


def test_not_finite_is_a_fault_like_any_laws():
    class NotANumber:
        def reset(self, input):
            pass

        def step(self, input):
            return math.nan

    run = abs_hil.simulate(NotANumber(), set=QUICK)
    assert run.summary['result'] == 'fault' and 'python' in run.summary['reason']


def test_signals_become_columns():
    class Signalling:
        signals = {'half_slip': 'half of the slip', 'ones': 'ones'}

        def reset(self, input):
            pass

        def step(self, input):
            return abs_hil.SlipOutput(3.0, theta_est_N=20.0, signals=[0.5 * input.slip, 1.0])

    run = abs_hil.simulate(Signalling(), set=QUICK)
    assert run.signals == ('half_slip', 'ones')
    brake = run.during('brake')
    assert (brake['ones'] == 1.0).all() and (brake['theta_est_N'] == 20.0).all()
    np.testing.assert_array_equal(brake['half_slip'], 0.5 * brake['slip_est'])
    Signalling.signals = {'no name': ''}
    with pytest.raises(ValueError, match='no name'):
        abs_hil.simulate(Signalling(), set=QUICK)


def test_plant_by_hand_keeps_its_energy_balance():
    """A wheel without contact loss: the lower wheel's angle is the integral of its speed, and friction only brakes."""
    plant = abs_hil.Plant('paper-table1')
    plant.reset(omega1_rad_s=99.5, omega2_rad_s=100.0)
    speeds, angle = [plant.state.omega2_rad_s], 0.0
    for _ in range(1000):
        plant.advance(1e-3)
        speeds.append(plant.state.omega2_rad_s)
        angle += 0.5e-3 * (speeds[-1] + speeds[-2])
    assert plant.state.angle2_rad == pytest.approx(angle, rel=1e-6)
    assert all(b < a for a, b in zip(speeds, speeds[1:]))
    for wrong in ({'duration_s': -1.0}, {'duration_s': math.nan}, {'duration_s': 0.1, 'brake_duty': 1.5},
                  {'duration_s': 0.1, 'motor_duty': math.nan}, {'duration_s': 0.1, 'brake_torque_Nm': -1.0},
                  {'duration_s': 0.1, 'brake_torque_Nm': math.inf}):
        with pytest.raises(ValueError, match=[*wrong][-1]):
            plant.advance(**wrong)
    with pytest.raises(ValueError, match='plant.ideal_actuator'):
        plant.advance(1e-3, brake_torque_Nm=1.0)
    with pytest.raises(ValueError, match='omega1_rad_s'):
        plant.reset(omega1_rad_s=math.nan)
    assert abs_hil.Plant(set={'plant.theta_N': 31}).theta_N == 31.0


def test_plant_branches():
    """A copy goes on as its original does, on a road that changes, with a brake that lags; a state is set and pickled."""
    drive = {'motor_duty': 0.0, 'brake_duty': 0.4}
    plant = abs_hil.Plant('inteco-manual', set={'plant.friction_profile': 'time: 1; 0.5 at 0.2'})
    plant.reset(omega1_rad_s=150.0, omega2_rad_s=150.0)
    plant.advance(0.15, **drive)
    branches = [plant.copy(), copy.copy(plant), copy.deepcopy(plant), pickle.loads(pickle.dumps(plant))]
    plant.advance(0.1, **drive)
    assert plant.friction == 0.5
    for branch in branches:
        assert branch.friction == 1.0, 'the copies stood still'
        branch.advance(0.1, **drive)
        assert repr(branch.state) == repr(plant.state)
    kept = pickle.loads(pickle.dumps(plant.state))
    plant.advance(0.1, **drive)
    after = repr(plant.state)
    plant.state = kept
    assert repr(plant.state) == repr(kept) != after
    plant.advance(0.1, **drive)
    assert repr(plant.state) == after, 'on an even road the state is all'


def test_a_duty_for_a_torque_and_a_long_time():
    plant = abs_hil.Plant('paper-table1')
    plant.advance(1.0, brake_duty=plant.brake_duty_for(4.0))
    assert plant.state.brake_torque_Nm == pytest.approx(4.0, rel=1e-6)
    assert plant.brake_duty_for(0.0) == 0.0 and plant.brake_duty_for(1e3) == 1.0
    with pytest.raises(ValueError, match='torque_Nm'):
        plant.brake_duty_for(float('nan'))
    with pytest.raises(ValueError, match='bogus.*no argument'):
        abs_hil.simulate_many([{'bogus': 1}])
    if hasattr(signal, 'SIGALRM'):
        def interrupt(*_):
            raise KeyboardInterrupt
        before = signal.signal(signal.SIGALRM, interrupt)
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        try:
            with pytest.raises(KeyboardInterrupt):
                plant.advance(1e6, motor_duty=0.5)
        finally:
            signal.signal(signal.SIGALRM, before)


def test_a_plant_with_every_flaw_is_copied_whole():
    """Dead time, hysteresis, fading, drift: a copy in the middle of them goes on as its original."""
    plant = abs_hil.Plant('inteco-manual', set={'plant.brake_dead_time_s': 0.02, 'plant.brake_hysteresis': 0.1,
                                                'plant.brake_fading_per_J': 1e-3,
                                                'plant.brake_torque_profile': 'time: 1; 0.7 at 0.3',
                                                'plant.friction_profile': 'distance: 1; 0.6 at 1'})
    plant.reset(omega1_rad_s=150.0, omega2_rad_s=150.0)
    for duty in (0.4, 0.1, 0.5, 0.3):
        plant.advance(0.007, brake_duty=duty)
    branch = pickle.loads(pickle.dumps(plant))
    for duty in (0.2, 0.6) * 20:
        plant.advance(0.011, brake_duty=duty)
        branch.advance(0.011, brake_duty=duty)
        assert repr(branch.state) == repr(plant.state)


@pytest.mark.parametrize('name', [name for name in abs_hil.controllers() if name != 'python'])
def test_laws_branch(name):
    """Copies of a law in the middle of a braking give what it gives; the law itself has moved on."""
    law = abs_hil.Controller(name)

    def inputs(n):
        omega2 = 170.0 - 0.05 * n
        slip = 0.1 + 0.05 * math.sin(0.02 * n)
        return abs_hil.SlipInput(dt_s=0.001 if n else 0.0, omega1_rad_s=omega2 * (1 - slip), omega2_rad_s=omega2, slip=slip,
                                 slip_ref=0.15, max_brake_torque_Nm=8.0, brake_torque_Nm=4.0, mean_brake_torque_Nm=4.0,
                                 alpha1_rad_s2=-50.0, alpha2_rad_s2=-50.0, upper_travel_rad=omega2 * (1 - slip) * 1e-3,
                                 lower_travel_rad=omega2 * 1e-3, sent_brake_torque_Nm=4.0)

    law.reset(inputs(0))
    for n in range(200):
        law.step(inputs(n))
    branches = [law.copy(), copy.deepcopy(law), pickle.loads(pickle.dumps(law))]
    expected = [repr(law.step(inputs(n))) for n in range(200, 400)]
    for branch in branches:
        assert [repr(branch.step(inputs(n))) for n in range(200, 400)] == expected


def test_law_by_hand():
    law = abs_hil.Controller('relay')
    inputs = {'dt_s': 0.0, 'omega1_rad_s': 168.0, 'omega2_rad_s': 170.0, 'slip_ref': 0.15, 'max_brake_torque_Nm': 8.0}
    law.reset(abs_hil.SlipInput(slip=0.0067, **inputs))
    assert law.step(abs_hil.SlipInput(slip=0.0067, **inputs)).brake_torque_Nm == 8.0, 'slip too small: full brake'
    with pytest.raises(ValueError, match='relay'):
        abs_hil.Controller('rely')
    with pytest.raises(ValueError, match='at most 8'):
        abs_hil.SlipOutput(1.0, signals=[0.0] * 9)


LAW = ('class Law:\n    def reset(self, input): pass\n'
       '    def step(self, input): return 4.0 + 60.0 * (input.slip_ref - input.slip)\n')


@pytest.mark.parametrize('name', ['test', 'code', 'random', 'signal', 'json', 'numpy', 'abs_hil', 'errno', 'own'])
def test_a_module_of_this_folder_is_taken_whatever_its_name(tmp_path, monkeypatch, name):
    """Python's own module of that name, and what imports it, stay as they are."""
    monkeypatch.chdir(tmp_path)
    before = dict(sys.modules)
    (tmp_path / f'{name}.py').write_text('import random\nimport numpy\nrandom.Random(), numpy.zeros(1)\n' + LAW)
    law = made(f'{name}:Law')
    assert pathlib.Path(inspect.getfile(type(law))) == tmp_path / f'{name}.py'
    assert type(made(f'{name}:Law')) is type(law)
    assert all(sys.modules[module] is before[module] for module in before)
    with pytest.raises(ValueError, match=f'{tmp_path}/{name}.py'):
        made(f'{name}:Other')
    (tmp_path / f'{name}.py').unlink()
    for module in set(sys.modules) - set(before):
        del sys.modules[module]


def test_packages_and_helpers_of_this_folder_are_taken(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = dict(sys.modules)
    (tmp_path / 'test').mkdir()
    (tmp_path / 'test/__init__.py').write_text('')
    (tmp_path / 'test/laws.py').write_text('from . import gains\nimport helper_of_law\n' + LAW)
    (tmp_path / 'test/gains.py').write_text('K = 3\n')
    (tmp_path / 'helper_of_law.py').write_text('')
    assert pathlib.Path(inspect.getfile(type(made('test.laws:Law')))) == tmp_path / 'test/laws.py'
    (tmp_path / 'code.py').write_text('import nothing_of_this_name\n')
    for _ in range(2):  # a module that failed is no module the second time
        with pytest.raises(ValueError, match='No module named .nothing_of_this_name'):
            made('code:Law')
    for module in set(sys.modules) - set(before):
        del sys.modules[module]


@pytest.mark.parametrize('name', ['test', 'code'])
def test_the_program_takes_a_module_of_its_folder(tmp_path, name):
    (tmp_path / f'{name}.py').write_text(LAW)
    result = subprocess.run([ABS_HIL.resolve(), '--fast', '--no-lcm', '--no-out', '--controller', f'{name}:Law', '--set',
                             'experiment.start_speed_rad_s=170'], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
