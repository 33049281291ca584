"""The picture of abs_hil watch: what a view makes of messages, and what the screen shows of it at any size."""
import math

import pytest

from abs_hil import TYPES
from abs_hil.messages import QUANTITIES, REASONS
from abs_hil.watch.screen import ALARM, Screen, draw, number, one_line, plot, range_of
from abs_hil.watch.view import BUCKETS, PLOTTED, RunView

NUMBER_OF = {name: number for number, name in enumerate(QUANTITIES['phase']['values'])}
UNKNOWN = math.nan


def message(type_name, sequence, **fields):
    made = TYPES[type_name]()
    for name, value in {'sequence': sequence, **fields}.items():
        setattr(made, name, value)
    return made


def cycle(sequence, **fields):
    """Message n of a 1 kHz run."""
    return message('telemetry_t', sequence, **{
        'cycle': sequence, 'time_s': sequence / 1000, 'phase': NUMBER_OF['brake'], 'omega1_rad_s': 80.0, 'omega2_rad_s': 100.0,
        'slip': 0.21, 'slip_ref': 0.2, 'theta_est_N': 22.5, 'theta_N': 23.0, 'sample_valid': True, **fields})


def status(sequence, **fields):
    times = {f'{name}_{q}_us': float(11 + i) for name in ('wakeup_latency', 'cycle_time')
             for i, q in enumerate(('p50', 'p99', 'p99_9', 'max'))}
    return message('status_t', sequence, **{'realtime': True, **times, **fields})


def event(sequence, kind, text):
    return message('event_t', sequence, kind=kind, message=text)


def experiment(sequence=0):
    return message('experiment_t', sequence, experiment='paper', controller='adaptive', plant='paper-table1', backend='sim')


def fed(view, start, end, **fields):
    """Each message arrives when it was sent."""
    for i in range(start, end):
        view.take(cycle(i, **fields), i / 1000)
    return view


def whole_run():
    """A run of 5 s."""
    view = RunView(10.0)
    view.take(experiment(), 0.0)
    view.take(event(0, 'phase', 'run started'), 0.0)
    fed(view, 0, 5000)
    view.take(status(5), 4.999)
    return view


def shown(view, now_s=4.9995, **screen):
    return '\n'.join(line.plain.rstrip() for line in draw(view, now_s, Screen(**screen)))


def styles(view, row, now_s=4.9995):
    return [str(span.style) for span in draw(view, now_s, Screen())[row].spans]


def test_the_screen_shows_all_quantities():
    text = shown(whole_run())
    assert text.splitlines()[0].startswith('abs_hil watch  paper · adaptive · paper-table1 · sim')
    assert text.splitlines()[0].endswith(' 1000 messages/s')
    assert text.splitlines()[1] == 'brake        4.999 s  ω1  80.0 ω2 100.0 rad/s  slip  0.210/0.200  θ̂  22.50 N'
    assert 'wake-up 11/12/13/14 cycle 11/12/13/14 µs, p50/p99/p99.9/max' in text
    assert 'overruns 0  drops 0  unpublished 0  lost on the way 0' in text
    assert '0.000 s phase    run started' in text
    assert '-10 s' in text and '-5 s' in text and 'now' in text and '━ true θ 23.000' in text
    assert text.splitlines()[-1] == 'q quits' and len(text.splitlines()) == 24


def test_one_line():
    assert one_line(RunView(10.0), 0.0, Screen()) == 'waiting for messages'
    assert one_line(whole_run(), 4.9995, Screen(unicode=False)) == (
        'brake        4.999 s  w1  80.0 w2 100.0 rad/s  slip  0.210/0.200  theta  22.50 N  overruns 0  drops 0  lost 0  '
        '1000 messages/s')


def test_at_standstill_slip_is_unknown_and_a_wheel_without_counts_stands():
    view = fed(RunView(10.0), 0, 100, omega2_rad_s=0.4, slip=1.0)
    assert math.isnan(view.values['slip']) and 'slip      -/0.200' in shown(view)
    rig = {name: UNKNOWN for name in ('omega1_rad_s', 'omega2_rad_s', 'slip', 'theta_N')}
    moving = RunView(10.0)
    for i in range(300):
        moving.take(cycle(i, **rig, omega1_est_rad_s=-12.8, omega2_est_rad_s=90.0, slip_est=0.3, upper_counts=7, lower_counts=i),
                    i / 1000)
    assert moving.values['omega1'] == 0.0 and moving.values['omega2'] == 90.0 and moving.values['slip'] == 0.3
    moving.take(cycle(300, **rig, omega1_est_rad_s=-12.8, upper_counts=8), 0.3)
    assert moving.values['omega1'] == -12.8
    assert 'nan' not in shown(moving).lower() + one_line(moving, 0.3, Screen()).lower()


def test_a_fault_is_shown_in_words_whole_and_without_its_event():
    view = whole_run()
    view.take(cycle(5000, phase=NUMBER_OF['fault'], reason=9999), 5.0)
    assert 'reason not received' in shown(view)
    overspeed = next(n for n, row in REASONS.items() if row['name'] == 'overspeed')
    view.take(cycle(5001, phase=NUMBER_OF['fault'], reason=overspeed), 5.0)
    assert REASONS[overspeed]['text'] in shown(view)
    long = 'wheel 2 turns at 190.25 rad/s, more than the limit of 180 rad/s in gate.overspeed_rad_s, so the outputs are at zero'
    view.take(event(1, 'fault', long), 5.0)
    for columns in (40, 80, 120):
        state = shown(view, columns=columns).split('slip  ━')[0]
        assert long in ' '.join(state.split()), (columns, state)
    assert ALARM in styles(view, 1)


def test_nothing_is_cut_at_80_columns():
    view = whole_run()
    view.take(status(6, overruns=3, telemetry_drops=4, realtime=False, **{
        f'{name}_{q}_us': 123456.0 for name in ('wakeup_latency', 'cycle_time') for q in ('p50', 'p99', 'p99_9', 'max')}), 5.0)
    view.take(cycle(5010, names=','.join(f'signal_{i}_Nm' for i in range(16)), values=[123.456] * 16, value_count=16), 5.01)
    view.malformed = 1
    text = shown(view, 5.01)
    for words in ('NOT IN REAL TIME', 'overruns 3', 'drops 4', 'lost on the way 10', 'malformed 1', 'signal_15_Nm 123.4560',
                  'p50/p99/p99.9/max'):
        assert words in text, text
    assert ALARM in [str(s.style) for line in draw(view, 5.01, Screen()) for s in line.spans if 'lost' in line.plain]


def test_waiting_silence_and_the_end_look_different():
    nothing = shown(RunView(10.0), source='udpm://here', channel='ABS_TELEMETRY')
    assert 'waiting for messages' in nothing and 'No message has arrived yet on ABS_TELEMETRY at udpm://here.' in nothing
    view = whole_run()
    assert '  no messages for 3.2 s' in shown(view, 8.199) and ALARM in styles(view, 0, 8.199)
    view.take(cycle(5000, phase=NUMBER_OF['stopped']), 5.0)
    assert 'run ended, no messages for 3.2 s' in shown(view, 8.2) and ALARM not in styles(view, 0, 8.2)


@pytest.mark.parametrize('value', [UNKNOWN, math.inf, -math.inf, 1e300, -1e300, 5e-324, 0.0])
def test_any_number_can_be_drawn(value):
    view = RunView(10.0)
    for i in range(100):
        fields = {name: value for name in ('omega1_rad_s', 'omega2_rad_s', 'slip', 'slip_ref', 'theta_est_N', 'theta_N')}
        view.take(cycle(i, **fields, phase=i - 50, reason=i * 300, **({'time_s': value} if i > 90 else {})), i / 1000)
    view.take(status(0, cycle_time_max_us=value), 0.0)
    assert len(draw(view, 0.1, Screen())) == 24 and one_line(view, 0.1, Screen())


def test_any_size_can_be_drawn():
    view = whole_run()
    view.take(event(1, 'limit', 'a long message ' * 12), 4.999)
    for columns in range(-1, 140, 3):
        for rows in range(-1, 60, 2):
            lines = draw(view, 4.999, Screen(columns, rows))
            assert len(lines) == max(rows, 0) and all(line.cell_len <= max(columns, 0) for line in lines), (columns, rows)
    assert 'slip  ━' in shown(view, rows=12) and shown(view, columns=200, rows=50, unicode=False).isascii()
    assert '*****' in shown(view, unicode=False)


def test_signals_are_the_controllers_own():
    view = RunView(10.0)
    view.take(cycle(0, names='upper_edge_age_ns,lower_edge_age_ns,zeta_N', values=[250.0, -1.0, 15.0], value_count=3), 0.0)
    assert view.signals() == {'zeta_N': 15.0}


def test_texts_from_the_network_are_made_printable():
    view = RunView(10.0)
    view.take(cycle(0, names='\x1b[2J,,a,b', values=[1.0] * 4, value_count=4, phase_name='\x1b[2J'), 0.0)
    view.take(event(0, 'limit', '\x1b]0;title\x07 and a text'), 0.0)
    text = shown(view, 0.0)
    assert '?[2J 1.0000' in text and '?]0;title? and a text' in text and '\x1b' not in text


def test_runs_losses_and_late_messages():
    view = fed(RunView(10.0), 100, 200)  # joined late: nothing is lost
    fed(view, 250, 260)
    assert view.lost == 50 and view.runs == 1
    view.take(cycle(258), 0.26)  # late
    assert view.runs == 1 and view.telemetry.sequence == 259
    view.take(event(5, 'phase', 'brake'), 0.26)
    view.take(event(0, 'command', 'stop accepted'), 0.26)  # between two runs of a series
    assert view.runs == 1 and view.events[-1].message == 'stop accepted'
    view.take(event(0, 'phase', 'run started'), 9.0)
    assert view.runs == 2 and len(view.events) == 1 and view.telemetry is None and not view.buckets
    fed(view, 0, 3000)
    view.take(cycle(700), 20.0)  # the first messages of the third run are lost
    assert view.runs == 3 and view.lost == 0 and 'run 3 seen here' in shown(view, 20.0)


def test_the_experiments_name_of_a_phase():
    view = whole_run()
    view.take(cycle(5000, phase_name='brake-low'), 5.0)
    assert shown(view, 5.0).splitlines()[1].startswith('brake-low    5.000 s')
    view.take(cycle(5001, phase=NUMBER_OF['fault'], phase_name='brake-low'), 5.0)
    assert one_line(view, 5.0, Screen()).startswith('fault ')


def drawn(values, columns, rows, unicode=False, limits=(0.0, 1.0)):
    """A plot of slip whose messages come evenly over the window; None: this message is lost."""
    view = RunView(10.0)
    for i, value in enumerate(values):
        if value is not None:
            view.take(cycle(i, time_s=10.0 * i / (len(values) - 1), slip=value, slip_est=value), 0.0)
    lines = plot(view.buckets, (('slip', '', '*'),), limits, columns, rows, unicode)
    return '\n'.join(line.plain.rstrip() for line in lines)


def test_plots():
    assert drawn([0.0, 1 / 3, 2 / 3, 1.0], 4, 4) == '   *\n  *\n *\n*'
    assert drawn([0.5] * 4 + [UNKNOWN] * 4 + [0.5] * 3, 11, 1) == '****    ***'
    assert drawn([0.5] * 4 + [None] * 4 + [0.5] * 3, 11, 1) == '****    ***'
    assert drawn([0.5] * 2, 11, 1) == '*' * 11  # decimated messages are joined
    assert drawn([1e300] * 5, 3, 3) == '***\n\n'
    assert drawn([-math.inf] * 5, 3, 3) == '\n\n***'
    spike = [0.0] * 500 + [1.0] + [0.0] * 499
    assert drawn(spike, 9, 2) == '    *\n*********'  # no peak is lost, however many messages share a dot
    for y, dot in enumerate('⠁⠂⠄⡀'):  # one dot, at the right of braille's two columns: its bit is three further
        assert drawn([1 - y / 3] * 2, 1, 1, True) == chr(ord(dot) | ord('⠈⠐⠠⢀'[y]))


def test_ranges():
    def limits(low, high):
        view = RunView(10.0)
        view.take(cycle(0, slip=low), 0.0)
        view.take(cycle(1, slip=high), 0.0)
        return pytest.approx(range_of(view.buckets, ('slip',), (0.0, 0.3), (-0.2, 1.0)))
    assert limits(0.1, 0.2) == (0.0, 0.3) and limits(0.1, 0.61) == (0.0, 0.8) and limits(-0.05, 0.2) == (-0.1, 0.2 + 0.1)
    assert limits(-1e300, 1e300) == (-0.2, 1.0)
    assert number(UNKNOWN, 2) == '-' and number(1e7, 2) == '1.0e+07' and len(PLOTTED) == 6 and BUCKETS == 400
