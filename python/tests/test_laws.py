"""MODULE:CLASS, a controller in Python, wherever a controller is named: runs, comparisons, studies, and their refusals."""
import csv
import signal
import time

import numpy as np
import pytest
from conftest import QUICK

import abs_hil

pytest.importorskip('abs_hil._network', reason='a wheel has no programs, and so no process for such a class')

LAWS = '''
import time
import abs_hil

class Proportional:
    signals = {"error": "wanted slip less slip"}
    def reset(self, input):
        self.steps = 0
    def step(self, input):
        self.steps += 1
        error = input.slip_ref - input.slip
        return abs_hil.SlipOutput(4.0 + 60.0 * error, signals=[error])

class Broken(Proportional):
    def step(self, input):
        super().step(input)
        return 1.0 / (self.steps - 100)

class Wordy(Proportional):
    def step(self, input):
        return "much"

class Numeral(Proportional):
    def step(self, input):
        return "4.0"

class Silent(Proportional):
    def step(self, input):
        pass

class Signs(Proportional):
    signals = 7

class Slow(Proportional):
    def step(self, input):
        time.sleep(0.02)
        return 4.0

class Chatty(Proportional):
    def reset(self, input):
        super().reset(input)
        print("begins")

class Failing(Proportional):
    def __init__(self):
        1 / 0

class Alone:
    pass

class Demanding(Proportional):
    def __init__(self, gain):
        pass
'''
QUICK_SET = ('--set', 'experiment.start_speed_rad_s=170')


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / 'laws.py').write_text(LAWS)
    (tmp_path / 'wrong.py').write_text('import abs_hil\nclass Law(:\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def test_a_named_class_runs_as_its_object(folder, abs_hil_program):
    import laws
    there = abs_hil.simulate('laws:Proportional', set=QUICK)
    here = abs_hil.simulate(laws.Proportional(), set=QUICK)
    assert there.signals == here.signals == ('error',)
    for name in ('brake_pwm', 'slip_est', 'error', 'omega1_est_rad_s'):
        assert np.array_equal(there[name], here[name], equal_nan=True), name
    abs_hil_program('--fast', '--no-lcm', '--controller', 'laws:Proportional', *QUICK_SET, '--csv', folder / 'run.csv')
    with open(folder / 'run.csv') as file:
        rows = [row for row in csv.reader(line for line in file if not line.startswith('#'))]
    duty = [float(row[rows[0].index('brake_pwm')]) for row in rows[1:]]
    assert np.array_equal(duty, here['brake_pwm'])


def test_a_comparison_and_a_study_take_it(folder, abs_hil_program):
    import laws
    abs_hil_program('compare', '--controllers', 'adaptive,soft=laws:Proportional', '--repeat', 3, '--runs', folder / 'runs.csv')
    with open(folder / 'runs.csv') as file:
        compared = [float(row['stop_distance_m']) for row in csv.DictReader(file) if row['controller'] == 'soft']
    objects = abs_hil.simulate_many({'controller': [laws.Proportional()], **{key: [value] for key, value in QUICK.items()}},
                                    vary=abs_hil.simulation.STANDARD_VARIATION, repeat=3)
    np.testing.assert_allclose(compared, objects['stop_distance_m'], rtol=1e-6)
    plan = {'controllers': ['adaptive', 'laws:Proportional'], 'factors': {'plant.theta_N': [20, 23]}}
    data = abs_hil.study(plan).data
    studied = data[data.controller == 'laws:Proportional']
    assert list(studied['result']) == ['completed', 'completed']
    alone = abs_hil.simulate(laws.Proportional(), set={**QUICK, 'plant.theta_N': 20})
    assert studied['stop_distance_m'].iloc[0] == pytest.approx(alone.summary['stop_distance_m'], rel=1e-6)


@pytest.mark.parametrize('name, said', [('laws:Nothing', "laws.py); give MODULE:CLASS"),
                                        ('nowhere:Law', "No module named 'nowhere'; give MODULE:CLASS"),
                                        ('laws:Alone', 'it has no methods reset and step'),
                                        ('laws:Demanding', 'the class is made without arguments'),
                                        ('laws:Failing', 'laws.py, line 46)\n'),
                                        ('wrong:Law', 'SyntaxError: invalid syntax (wrong.py, line 2)\n'),
                                        ('my-laws:Law', 'MODULE:CLASS')])
def test_a_class_that_cannot_be_used_is_refused_by_name(folder, name, said, abs_hil_program):
    result = abs_hil_program('--fast', '--no-lcm', '--controller', name, *QUICK_SET, status=2)
    assert name in result.stderr and said in result.stderr
    assert 'programs.py' not in result.stderr and 'At:' not in result.stderr  # no traceback through the program's own code


@pytest.mark.parametrize('name, said', [('Broken', 'ZeroDivisionError'), ('Wordy', "step returned 'much'; give"),
                                        ('Numeral', "step returned '4.0'; give"), ('Silent', 'step returned None; give')])
def test_what_its_step_raises_ends_the_run_with_a_fault(folder, name, said, abs_hil_program):
    import laws
    result = abs_hil_program('--fast', '--no-lcm', '--controller', f'laws:{name}', *QUICK_SET, status=1)
    assert said in result.stderr
    assert f'(controller laws:{name}): its code ended its process with status 1 in step' in result.stdout + result.stderr
    if name != 'Broken':
        assert 'Traceback' not in result.stderr
        with pytest.raises(TypeError, match=said):
            abs_hil.simulate(getattr(laws, name)(), set=QUICK)


def test_signals_that_are_none_are_refused_alike(folder):
    import laws
    for controller, whose in (('laws:Signs', 'controller laws:Signs: '), (laws.Signs(), '')):
        with pytest.raises(ValueError, match=f"{whose}the controller's signals are 7; give a dictionary"):
            abs_hil.simulate(controller, set=QUICK)


def test_a_signal_ends_a_run_of_slow_steps_at_once(folder):
    def interrupt(*_):
        raise KeyboardInterrupt
    before = signal.signal(signal.SIGALRM, interrupt)
    begun_s = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    try:
        with pytest.raises(KeyboardInterrupt):
            abs_hil.simulate('laws:Slow', set=QUICK)
        lasted_s = time.monotonic() - begun_s
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert lasted_s < 5.0  # 1000 steps take 20 s


def test_a_file_of_an_agent_that_is_missing():
    with pytest.raises(ValueError, match='nope.agent: No such file.*abs_hil.learning.rig_environment makes this file'):
        abs_hil.simulate('nope.agent')


def test_what_it_prints_comes_out_on_stderr(folder, abs_hil_program):
    result = abs_hil_program('--fast', '--no-lcm', '--controller', 'laws:Chatty', *QUICK_SET)
    assert 'begins\n' in result.stderr and 'begins' not in result.stdout


@pytest.mark.parametrize('accepted, said', [('false', 'try it with --backend sim first'),
                                            ('true', 'a class in Python cannot control a board')])
def test_a_board_is_refused(folder, accepted, said, abs_hil_program):
    result = abs_hil_program('--backend', 'rig', '--no-lcm', '--controller', 'laws:Proportional', '--set',
                             f'unsafe.foreign_controller={accepted}', status=2)
    assert said in result.stderr
