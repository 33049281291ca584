"""The test of research/reproduce.py: every figure and table has its row, and the runner makes, compares and resumes."""
import pathlib
import re
import subprocess
import sys

import pytest
from steps import Step, marks, rows

ROOT = pathlib.Path(__file__).resolve().parents[1]
ROWS = rows(ROOT / 'research' / 'steps.toml')
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').rglob('*.md'))]
STORED = [*sorted((ROOT / 'docs/reference').iterdir()), *sorted((ROOT / 'docs/figures').iterdir())]
MADE = {made for step in ROWS.values() for made in step.makes}


def named(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize('path', STORED, ids=named)
def test_every_figure_and_reference_file_has_a_row(path):
    assert named(path) in MADE


@pytest.mark.parametrize('page', PAGES, ids=named)
def test_every_marked_table_has_a_row(page):
    assert [mark for mark in marks(page.read_text(encoding='utf-8'))
            if not {f'{named(page)}#{mark}', named(page)} & MADE] == []


@pytest.mark.parametrize('page', PAGES, ids=named)
def test_every_program_of_research_that_a_page_names_has_a_row(page):
    programs = set(re.findall(r'research/\w+\.(?:py|sh)', page.read_text(encoding='utf-8'))) - {'research/reproduce.py'}
    assert sorted(programs - {word for step in ROWS.values() for word in step.run.split()}) == []


@pytest.mark.parametrize('step', ROWS.values(), ids=ROWS)
def test_what_a_row_names_exists(step):
    for made in step.makes:
        file, _, mark = made.partition('#')
        assert (ROOT / file).is_file()
        assert not mark or mark in marks((ROOT / file).read_text(encoding='utf-8'))
    for word in step.run.split():
        assert '/' not in word or '{' in word or '*' in word or (ROOT / word).is_file(), word
    assert step.manner() != 'prints' or step.by_hand or len(step.makes) <= 1


PAGE = 'It stops after 1.5 s.\n<!-- t -->\n| 1 |\n<!-- end -->\n'
#: each run of a step adds a line to the file `runs`
PROGRAM = '''import pathlib, sys
what, out = sys.argv[1:3]
with open('runs', 'a') as runs: runs.write(what + '\\n')
if what == 'table': print('| 2 |')
if what == 'sentence': print('stops after 1.7 s')
if what == 'file': pathlib.Path(out, 'docs/one.csv').write_text('a,b\\n1,2\\n')
if what == 'wrong': sys.exit('the numbers are wrong')
'''
STEPS = '''
[table]
run = "{python} research/make.py table -"
makes = ["docs/page.md#t"]
after = ["file"]
[sentence]
run = "{python} research/make.py sentence -"
makes = ["docs/page.md"]
[file]
run = "{python} research/make.py file {out}"
makes = ["docs/one.csv"]
inputs = ["config/*.toml"]
[old]
run = "{python} research/make.py old -"
by_hand = "2026-01-01: long"
'''


@pytest.fixture
def tree(tmp_path):
    for folder in ('docs', 'research', 'config', 'build/release/bin'):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / 'docs/page.md').write_text(PAGE)
    (tmp_path / 'config/a.toml').write_text('a = 1\n')
    (tmp_path / 'research/make.py').write_text(PROGRAM)
    (tmp_path / 'research/steps.toml').write_text(STEPS)
    return tmp_path


def reproduce(tree, *options):
    """Status, output, and the steps that ran."""
    (tree / 'runs').write_text('')
    done = subprocess.run([sys.executable, ROOT / 'research/reproduce.py', '--root', tree, *options],
                          capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr, (tree / 'runs').read_text().split()


def test_what_is_written_is_the_same_and_is_not_made_again(tree):
    status, said, ran = reproduce(tree, '--write')
    assert (status, sorted(ran)) == (0, ['file', 'sentence', 'table']), said
    assert ran.index('file') < ran.index('table')
    assert (tree / 'docs/page.md').read_text() == PAGE.replace('1.5', '1.7').replace('| 1 |', '| 2 |')
    assert (tree / 'docs/one.csv').read_text() == 'a,b\n1,2\n'
    assert 'by hand, 2026-01-01' in said
    assert reproduce(tree, '--check')[0] == 0
    assert reproduce(tree, '--check')[2] == []
    (tree / 'config/a.toml').write_text('a = 2\n')
    assert reproduce(tree, '--check')[2] == ['file']
    assert reproduce(tree, '--check', '--only', 'old')[2] == ['old']
    assert sorted(reproduce(tree, '--check', '--fresh')[2]) == ['file', 'sentence', 'table']


@pytest.mark.parametrize('file, old, new', [('page.md', '| 2 |', '| 3 |'), ('page.md', '1.7', '2.7'), ('one.csv', '1,2', '1,4')])
def test_a_changed_page_is_named(tree, file, old, new):
    reproduce(tree, '--write')
    path = tree / 'docs' / file
    path.write_text(path.read_text().replace(old, new))
    status, said, _ = reproduce(tree, '--check')
    assert status == 1
    assert re.search(rf'^docs/{file}: -.*{re.escape(new)}', said, re.MULTILINE)
    assert new in path.read_text()


def test_a_failed_step_is_named_and_its_followers_are_not_run(tree):
    (tree / 'research/steps.toml').write_text(STEPS.replace('make.py file', 'make.py wrong'))
    status, said, ran = reproduce(tree, '--check')
    assert (status, sorted(ran)) == (1, ['sentence', 'wrong'])
    assert 'the numbers are wrong' in said and 'not run: file did not end well' in said


def test_rows_must_name_what_there_is(tree):
    path = tree / 'research/steps.toml'
    for added, words in (('after = ["none"]', 'there are'), ('uses = ["none"]', 'there are'),
                         ('after = ["table"]', 'wait for each')):
        path.write_text(STEPS.replace('[sentence]', f'[other]\nrun = "x"\n{added}\n[sentence]').replace(
            'after = ["file"]', 'after = ["file", "other"]'))
        with pytest.raises(ValueError, match=words):
            rows(path)


def test_manners():
    assert [Step('a', run).manner() for run in ('x {mode}', 'x --to {out}/y', 'x {build}')] == ['mode', 'out', 'prints']
