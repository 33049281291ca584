"""What an identification says while it works, when it is interrupted, and of logs that cannot tell a parameter."""
import dataclasses
import io
import json
import signal
import subprocess

import pytest
from conftest import ABS_HIL

import abs_hil
from abs_hil.identification.advice import log_of
from abs_hil.identification.found import refuse
from abs_hil.identification.program import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_sees_the_time_that_passed_and_a_line_that_goes(monkeypatch):
    now = [100.0]
    monkeypatch.setattr('time.monotonic', lambda: now[0])
    screen = Terminal()
    progress = Progress(screen)
    progress.say('one form: first values')
    now[0] += 39.0
    progress.check()
    assert screen.getvalue().endswith('\r\x1b[K39 s')
    now[0] += 600.0
    progress.check()
    assert screen.getvalue().endswith('\r\x1b[K11 min')
    progress.end()
    progress.say('a note')
    progress.check()
    assert screen.getvalue().endswith('\r\x1b[Kabs_identify: a note\n')


def test_a_pipe_gets_lines_only():
    pipe = io.StringIO()
    progress = Progress(pipe)
    progress.say('one form: first values')
    progress.check()
    progress.end()
    assert pipe.getvalue() == 'abs_identify: one form: first values\n'


def test_interrupted_it_says_what_it_keeps_and_how_to_go_on(tmp_path):
    for name in ('lifted', 'pulses'):
        subprocess.run([ABS_HIL, '--fast', '--no-lcm', '--experiment', name, '--out', tmp_path / name], check=True,
                       capture_output=True)
    program = ABS_HIL.parent / 'abs_identify'
    running = subprocess.Popen([program, tmp_path / 'lifted', tmp_path / 'pulses', '--no-report', '--form', 'magic-formula',
                                '--out', tmp_path / 'found'], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for line in running.stderr:
        if line.endswith(': fit\n'):
            running.send_signal(signal.SIGINT)
            break
    said = running.stderr.read()
    running.communicate()
    assert running.returncode == 130
    assert 'interrupted: the values so far are kept' in said
    assert '--force' in said
    kept = json.loads((tmp_path / 'found' / 'identified.json').read_text())
    assert all(row['low'] is None for row in kept['parameters'].values() if row['status'] != 'fixed')


def test_a_duty_below_which_the_brake_gives_nothing_is_u0_and_no_experiment_is_asked_for():
    logs = [log_of(name, {'plant.u0': 0.35}) for name in ('lifted', 'duty-ramp')]
    found = abs_hil.identify(logs, form='magic-formula')
    assert found.parameters['u0'].value == pytest.approx(6.21 / 15.24, abs=2e-3)  # where 15.24 u - 6.21 is 0
    assert found.parameters['u0'].status == 'bounded'
    assert any('no log tells where below it u0 lies' in note for note in found.notes)
    assert not any('u0' in note and 'run:' in note for note in found.notes)


def test_an_experiment_among_the_logs_is_not_asked_for_again():
    coast = log_of('coast-and-brake', {})
    notes = abs_hil.identify([coast], form='magic-formula').notes
    assert any('M10_Nm' in note and note.endswith('run: lifted') for note in notes)
    assert any('motor_stall_torque_Nm' in note and note.endswith('run: pulses') for note in notes)
    notes = abs_hil.identify([dataclasses.replace(coast, experiment='lifted')], form='magic-formula').notes
    assert any('M10_Nm' in note and 'lifted is among the logs and did not suffice' in note for note in notes)
    assert not any('run: lifted' in note for note in notes)
    assert any('motor_stall_torque_Nm' in note and note.endswith('run: pulses') for note in notes)
    # In a refusal only where it is known what was run, and only what was not.
    for experiment, asked in (('locked-stop', True), ('', False)):
        found = abs_hil.identify([dataclasses.replace(log_of('locked-stop', {}), experiment=experiment)], form='magic-formula')
        refuse(found, 'the logs are of another plant', [], False)
        assert found.misfit and any('run: lifted' in note for note in found.notes) == asked
        assert not any('among the logs' in note for note in found.notes)
