"""Eccentricity from the counts of coasting wheels: offline into the model, and within a run before braking."""
from __future__ import annotations

import numpy as np
import pytest

import abs_hil
from abs_hil import eccentricity

FLAWS = {'plant.upper_encoder_eccentricity_rad': 0.01, 'plant.upper_encoder_phase_rad': 1.0,
         'plant.lower_encoder_eccentricity_rad': 0.006, 'plant.lower_encoder_phase_rad': -2.0}
UNKNOWN = {'model.upper_encoder_eccentricity_rad': 0.0, 'model.lower_encoder_eccentricity_rad': 0.0}


def braking(controller='adaptive-peak', **changes):
    return abs_hil.simulate(controller, experiment='coast-and-brake', set={**FLAWS, **changes})


def speed_error(run, wheel):
    """Largest error of a wheel's estimated speed in the first quarter of braking, as a part of its speed."""
    rows = np.flatnonzero(run.columns['phase'] == 'brake')
    rows = rows[:len(rows) // 4]
    true = run.columns[f'omega{wheel}_rad_s'][rows]
    return float(np.abs(run.columns[f'omega{wheel}_est_rad_s'][rows] / true - 1.0).max())


def test_fit_finds_what_the_encoder_has(tmp_path):
    run = braking(**UNKNOWN)
    found = eccentricity.of_run(run)
    for wheel, e, phase in (('upper', 0.01, 1.0), ('lower', 0.006, -2.0)):
        disc = found[wheel]
        assert disc.sd_rad < 1e-4
        assert disc.eccentricity_rad == pytest.approx(e, abs=5 * disc.sd_rad)
        assert disc.phase_rad == pytest.approx(phase, abs=5 * disc.sd_rad / e)
    assert eccentricity.of_run(braking(**{key: 0.0 for key in FLAWS}))['upper'].eccentricity_rad < 2e-4


def test_program_writes_keys_that_the_program_reads(tmp_path, capsys):
    run = tmp_path / 'run.csv'
    given = braking(**UNKNOWN)
    given.data.to_csv(run, index=False, na_rep='NaN')
    out = tmp_path / 'model.toml'
    assert eccentricity.main([str(run), '--out', str(out)]) == 0
    keys = abs_hil.keys(config=out)
    assert keys['model.upper_encoder_eccentricity_rad']['value'] == pytest.approx(0.01, abs=1e-4)
    corrected = abs_hil.simulate('adaptive-peak', experiment='coast-and-brake', set=FLAWS, config=out)
    assert speed_error(corrected, 1) < 0.4 * speed_error(given, 1)
    assert eccentricity.main([str(tmp_path / 'none.csv')]) == 2
    assert 'none.csv' in capsys.readouterr().err


def test_learning_while_coasting_does_as_well_as_knowing():
    unknown, known = braking(**UNKNOWN), braking()
    learnt = braking(**UNKNOWN, **{'control.observer.learn_eccentricity_s': 0.4})
    without = abs_hil.simulate('adaptive-peak', experiment='coast-and-brake', set={key: 0.0 for key in FLAWS})
    for wheel in (1, 2):
        assert speed_error(unknown, wheel) > 2.0 * speed_error(known, wheel)
        assert speed_error(learnt, wheel) < 1.2 * speed_error(known, wheel)
    distance = {name: run.summary['stop_distance_m'] for name, run in
                (('unknown', unknown), ('known', known), ('learnt', learnt), ('without', without))}
    assert distance['unknown'] > 1.05 * distance['without']
    assert distance['known'] == pytest.approx(distance['without'], rel=0.03)
    assert distance['learnt'] == pytest.approx(distance['without'], rel=0.03)


def test_a_wheel_that_hardly_turns_is_refused():
    with pytest.raises(ValueError, match='at least 3 turns'):
        eccentricity.fit(np.arange(100) * 1e-3, np.arange(100), 4096)
