"""`abs_hil lab` without a browser: exercises, and the page's parts. tests/lab looks at the page itself."""
import base64
import gzip
import json
import os
import re

import pytest

from abs_hil import programs
from abs_hil.lab import page

WASM = b'\0asm\1\0\0\0'


@pytest.fixture
def with_module(monkeypatch):
    monkeypatch.setattr(page, 'module', lambda: WASM)


def test_the_ready_exercises_can_be_read():
    assert [path.stem for path in page.exercises()] == ['break-the-sliding-mode', 'nominal-unknown-tyre', 'slip-of-the-peak']
    for path in page.exercises():
        given = page.read_exercise(page.found(path.stem))
        assert given['goals'] and given['task'] and given['offered']['keys']
        # A controller that follows the plant's values would know what is hidden.
        for key in given['hidden']['set']:
            assert 'model.' + key.removeprefix('plant.') in given['start']['set']


@pytest.mark.parametrize('text, message', [
    ('title = "a"', 'task is missing'),
    ('titel = "a"', 'unknown key titel; known: title'),
    ('title = "a"\ntask = 3', 'task = 3: give a str'),
    ('title = ', 'not valid TOML'),
    ('title = "a"\ntask = "b"\n[hidden]\nset = { "plant.thetaN" = 3 }', r'exercise\.toml: .*plant\.theta_N'),
    ('title = "a"\ntask = "b"\n[start]\nset = { "plant.theta_N" = -3 }', r'exercise\.toml: .*\(0, 100000\]'),
    ('title = "a"\ntask = "b"\n[hidden]\ncolumns = ["thetaN"]', 'hidden.columns: unknown "thetaN"; known: .*omega1_rad_s'),
    ('title = "a"\ntask = "b"\n[offered]\nplants = ["mars"]', 'offered.plants: unknown "mars"; known: .*paper-table1'),
    ('title = "a"\ntask = "b"\n[offered]\nkeys = ["plant.B"]\n[hidden]\nset = { "plant.B" = 20 }', 'plant.B is in hidden.set too'),
    ('title = "a"\ntask = "b"\n[[goal]]\nfigure = "slip"', 'goal.figure: unknown "slip"; known: .*slip_rms'),
    ('title = "a"\ntask = "b"\n[[goal]]\nfigure = "slip_rms"\nsays = "c"\nat_most = nan', 'at_most = nan: give finite numbers'),
    ('title = "a"\ntask = "b"\n[start]\nset = { "plant.theta_N" = inf }', 'start.set = .*: give finite numbers'),
    ('title = "a"\ntask = "b"\n[[goal]]\nfigure = "slip_rms"\nsays = "c"', 'goal of slip_rms: give says, and at_most or at_least'),
])
def test_refused_exercises(tmp_path, text, message):
    path = tmp_path / 'exercise.toml'
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        page.read_exercise(path)


@pytest.mark.skipif(not os.path.exists('/dev/zero'), reason='needs a device without an end')
def test_an_exercise_without_an_end():
    with pytest.raises(ValueError, match='"/dev/zero": File too large; give a TOML file'):
        page.read_exercise(page.found('/dev/zero'))


def test_a_task_has_its_own_lines(tmp_path):
    path = tmp_path / 'exercise.toml'
    path.write_text('title = "a"\ntask = """\nOne\ntwo.\n\n1. Three\n   four.\n2. Five.\n"""')
    assert page.read_exercise(path)['task'] == 'One two.\n\n1. Three four.\n2. Five.'


def test_the_page_holds_all_it_needs(tmp_path, with_module):
    out = tmp_path / 'lab.html'
    assert page.main(['--out', str(out), '--exercise', 'slip-of-the-peak']) == 0
    text = out.read_text()

    def part(name):
        return gzip.decompress(base64.b64decode(re.search(f'id="{name}">([^<]*)<', text)[1]))
    assert part('module') == WASM
    assert json.loads(part('page'))['exercise']['hidden']['set']['plant.B'] == 12
    assert '<title>Find the slip of the peak by hand</title>' in text
    for other in ('http://', 'https://', 'import ', 'src='):
        assert other not in re.sub(r'<script>/\*! https://github.com/leeoniya/uPlot.*?</script>', '', text, flags=re.S), other


def test_without_the_module(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(page, '_FOLDER', tmp_path)
    assert programs.start('lab', ['--out', str(tmp_path / 'lab.html')]) == 3
    assert 'abs_hil_lab.wasm) is missing; scripts/lab.sh' in capsys.readouterr().err
    assert not (tmp_path / 'lab.html').exists()


def test_an_exercise_that_is_not_there(tmp_path, with_module, capsys):
    assert page.main(['--out', str(tmp_path / 'lab.html'), '--exercise', 'nowhere']) == 2
    assert re.search('nowhere.*give a TOML file, or one of .*slip-of-the-peak', capsys.readouterr().err)
