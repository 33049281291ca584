"""The plants that stand for the measured rig follow the measured traces; the printed model does not."""
import csv
import tomllib

import numpy as np
import pytest
from measured_traces import DATA, STEPS, compared, measured_peaks, peaks, relay_closed

import abs_hil

# Largest RMS errors: the fits of the traces reach two thirds of them. Shipped plants as they are: dead times and lags of both
# edges, overshoot at full duty, no swing once a turn, no eccentricity.
OPEN_LOOP = (25.0, 0.030)  # rpm, slip
RUN_UP_RPM = 10.0
STEPS_M_S = {'0.65': (0.45, 0.25), '0.7': (0.40, 0.15), '0.75': (0.60, 0.20)}
CLOSED_PEAK, CLOSED_M, CLOSED_S = 0.06, (26.8, 1.5), (3.01, 0.25)


def closed_is_right(plant):
    slips, way_m, time_s = relay_closed(abs_hil.Plant(plant))
    wanted = [float(text) for text in measured_peaks().split()]
    found = peaks(slips)
    return (len(found) == len(wanted) and np.all(np.abs(found - wanted) <= CLOSED_PEAK)
            and abs(way_m - CLOSED_M[0]) <= CLOSED_M[1] and abs(time_s - CLOSED_S[0]) <= CLOSED_S[1])


def within(plant, trace, bounds):
    return bool(np.all(np.less_equal(compared(abs_hil.Plant(plant), [trace])[trace].errors, bounds)))


def test_the_relay_run_is_followed_under_the_recorded_commands():
    assert within('measured-relay', 'relay', OPEN_LOOP)


def test_a_relay_in_the_simulation_does_what_the_measured_one_did():
    assert closed_is_right('measured-relay')


@pytest.mark.parametrize('duty', STEPS)
def test_the_steps_are_followed(duty):
    assert within('measured-step', duty, STEPS_M_S[duty])


@pytest.mark.parametrize('plant', ['measured-step', 'measured-relay'])
def test_the_run_up_has_both_slopes(plant):
    assert within(plant, 'run-up', RUN_UP_RPM)


def test_no_printed_plant_passes():
    for plant in ('inteco-manual', 'paper-table1', 'paper-timing'):
        assert not within(plant, 'relay', OPEN_LOOP)
        assert not closed_is_right(plant)
        assert not all(within(plant, duty, STEPS_M_S[duty]) for duty in STEPS)
        assert not within(plant, 'run-up', RUN_UP_RPM)


def test_both_sessions_are_of_one_rig_but_for_the_friction():
    one, other = ({name: row['value'] for name, row in abs_hil.keys(plant=plant).items() if name.startswith('plant.')}
                  for plant in ('measured-step', 'measured-relay'))
    friction = {'plant.theta_N', 'plant.mu_w1', 'plant.mu_w2', 'plant.mu_w3', 'plant.mu_w4'}
    assert {name for name in one if one[name] != other[name]} == friction


def of_rig(values):
    """The quantities of rig.csv of a plant, by their names there."""
    def torque_Nm(duty):
        return values['b1_Nm'] * duty + values['b2_Nm']
    return {**{f'brake torque at duty {duty}': torque_Nm(float(duty)) for duty in (*STEPS, '1')},
            "end of the brake's dead zone": values['u0'], 'dead time taking hold': values['brake_dead_time_s'],
            'dead time letting go': values['brake_dead_time_s'] - values['brake_release_lead_s'],
            'lag taking hold': values['c31_per_s'], 'lag letting go': values['c31_per_s'] * values['brake_release_ratio'],
            'overshoot at duty 1': values['brake_overshoot'], 'rate at which it fades': values['brake_overshoot_per_s'],
            'swing of the torque once a turn': values['brake_ripple_Nm'], 'J1 (only J1/J2 is determined)': values['J1_kg_m2'],
            'eccentricity of the lower encoder': values['lower_encoder_eccentricity_rad'],
            "motor's stall torque through the start resistor": values['motor_start_torque_Nm'],
            "motor's stall torque without it": values['motor_stall_torque_Nm'],
            "lower wheel's speed that bridges it": values['motor_start_until_rad_s'],
            "motor's no-load speed": values['motor_no_load_speed_rad_s'], 'M20': values['M20_Nm']}


def rows_of_rig():
    with open(DATA / 'rig.csv', encoding='utf-8') as file:
        return {row['quantity']: row for row in csv.DictReader(file)}


def test_the_plants_have_the_values_of_the_table():
    rows = rows_of_rig()
    for plant, session, friction in (('measured-step', 'friction of the steps over the printed curve', 1.0),
                                     ('measured-relay', 'friction of the relay session over it', 0.53)):
        values = {name.removeprefix('plant.'): row['value'] for name, row in abs_hil.keys(plant=plant).items()}
        for name, value in of_rig(values).items():
            assert float(rows[name]['in_the_plants']) == pytest.approx(value, rel=2e-3, abs=1e-9), (plant, name)
        assert rows[session]['in_the_plants'] == f'{friction:g} ({plant})'
        printed = abs_hil.keys(plant='inteco-manual')['plant.mu_w4']['value']
        assert values['mu_w4'] == pytest.approx(friction * printed, rel=1e-6)


def test_the_family_fills_the_ranges_of_the_table():
    plants = [tomllib.loads(abs_hil.simulate('locked', set={'experiment.start_speed_rad_s': 20.0}, vary='measured',
                                             repetition=number).config_toml)['plant'] for number in range(60)]
    rows, drawn = rows_of_rig(), [of_rig(values) for values in plants]
    printed = abs_hil.keys(plant='inteco-manual')['plant.mu_w4']['value']
    found = {name: [one[name] for one in drawn] for name in drawn[0]}
    found['friction of the relay session over it'] = [values['mu_w4'] / printed for values in plants]
    found = {name: values for name, values in found.items() if rows[name]['drawn_from'] not in ('', 'as taking hold')}
    assert len(found) == 16
    for name, values in found.items():
        low, high = float(rows[name]['drawn_from']), float(rows[name]['drawn_to'])
        assert low - 1e-9 <= min(values) and max(values) <= high + 1e-9, name
        assert max(values) - min(values) >= 0.8 * (high - low), name
