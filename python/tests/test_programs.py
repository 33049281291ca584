"""The programs in Python without their packages, and with packages that do not fit each other: --help and --version need
none, and everything else says in one line what is missing and which command mends it."""
import os
import pathlib
import re
import subprocess
import sys

import pytest

import abs_hil
from abs_hil import parsers, programs
from abs_hil.identification.parameters import FORMS

#: where this package is; Python without any other has its folder alone
PLACES = [str(pathlib.Path(folder).parent) for folder in abs_hil.__path__]
#: program -> arguments with which it reaches its packages
WORK = {'report': ['{run}', '--out', '{out}/page.html', '--force', '--figures', '{out}/figures'],
        'tune': ['--out', '{out}', '--controllers', 'pi', '--generations', '1'],
        'learn': ['--generations', '1', '--figure', '{out}/curve.svg'], 'identify': ['{run}', '--out', '{out}/identified'],
        'benchmark': ['--quick', '--controller', 'pi', '--out', '{out}/page.html'], 'convert': ['{run}', '{out}/run.mcap'],
        'watch': ['--window', '10'], 'export-fmu': ['--out', '{out}/rig.fmu', '--force'], 'serve': ['{run}', '--port', '-1'],
        'lab': ['--out', '{out}/lab.html'], 'log': ['info', '{run}'], 'rig': ['steady', '1', '--out', '{out}/rig.toml', '--force'],
        'python_host': [], 'compare_tables': []}
#: package -> programs that need it for this
NEEDED = {'numpy': ('report', 'tune', 'learn', 'identify', 'benchmark', 'convert', 'serve', 'lab', 'log', 'rig',
                    'compare_tables'),
          'pandas': ('report', 'identify', 'convert', 'log'), 'scipy': ('tune', 'identify'), 'matplotlib': ('report', 'learn'),
          'jinja2': ('report', 'benchmark'), 'rich': ('watch',), 'aiohttp': ('serve',), 'mcap': ('convert',)}
#: what packages of others raise that were built for, or ask for, another NumPy
BROKEN = {'ValueError': "raise ValueError('numpy.dtype size changed, may indicate binary incompatibility. Expected 96, got 88')",
          'ImportError': "raise ImportError('\\n\\nIMPORTANT: PLEASE READ THIS\\n\\nnumpy.core.multiarray failed to import')",
          'AttributeError': "import numpy; numpy.no_such_type", 'ModuleNotFoundError': 'import a_package_that_this_one_needs',
          'RuntimeError': "raise RuntimeError('module compiled against API version 0x10 but this version of numpy is 0xf')",
          'NumPy 2': '''if __name__ == 'pandas':
    import sys
    sys.stderr.write('A module that was compiled using NumPy 1.x ...\\nTraceback (most recent call last):\\n')
raise ImportError('numpy.core.multiarray failed to import')'''}
HIDES = '''
import sys
class Hidden:
    def find_spec(name, path=None, target=None):
        if name.partition('.')[0] == {package!r}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)
sys.meta_path.insert(0, Hidden)
'''


def started(name, arguments, before='', python=(), folder=None):
    code = (f'import sys\nsys.path[:0] = {PLACES!r}\n{before}\nfrom abs_hil.programs import start\n'
            f'sys.argv[0] = "abs_{name}"\nsys.exit(start({name!r}, {[str(argument) for argument in arguments]!r}))')
    environment = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    return subprocess.run([sys.executable, *python, '-c', code], capture_output=True, text=True, timeout=120, cwd=folder,
                          env={**environment, 'PYTHONDONTWRITEBYTECODE': '1'}, check=False)


def says_what_to_do(ended, name, package):
    assert ended.returncode == 3, (ended.returncode, ended.stdout, ended.stderr)
    command = r'(setup\S*\.sh \S+\.txt|pip install|apt-get).*'
    assert re.fullmatch(rf'(abs_{name}: note: .*\n)*abs_{name}: .*\b{package}\b.*; (install|mend) it: .*{command}\n',
                        ended.stderr), ended.stderr


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """A run as a CSV, for programs that read one."""
    path = tmp_path_factory.mktemp('programs') / 'run.csv'
    abs_hil.simulate().to_csv(path)
    return path


def test_every_program_is_in_the_table():
    assert WORK.keys() == programs.PROGRAMS.keys()


@pytest.mark.parametrize('name', programs.PROGRAMS)
def test_help_and_version_need_no_package(name):
    python = ('-I', '-S')  # nothing but Python's own modules
    shown = started(name, ['--help'], python=python)
    assert (shown.returncode, shown.stderr) == (0, '') and shown.stdout.startswith('usage: abs_'), shown.stderr
    version = started(name, ['--version'], python=python)
    assert version.returncode == 0 and re.fullmatch(rf'abs_{name} {re.escape(abs_hil.__version__)} \(\S+\)\n', version.stdout)
    wrong = started(name, ['--no-such-option'], python=python)
    assert wrong.returncode == 2 and 'Traceback' not in wrong.stderr


def test_help_names_the_forms():
    assert all(name in parsers.identify().format_help() for name in FORMS)


#: program -> what comes before its --out, the name that was once its option, endings that are refused, what is possible
OUT = {'report': (['a'], '--output', ['.pdf', '.csv', '.json', '.md'], 'FILE.html'),
       'tune': ([], '--folder', ['.toml', '.json'], 'a folder'), 'learn': ([], '--output', ['.csv', '.svg'], 'FILE.json'),
       'identify': (['a'], '--out', ['.toml', '.html'], 'a folder'),
       'benchmark': ([], '--page', ['.pdf', '.json'], 'FILE.html or FILE.md'),
       'export-fmu': ([], '--out', ['.zip.pdf', '.so.csv'], 'FILE.fmu'), 'lab': ([], '--out', ['.pdf'], 'FILE.html'),
       'rig': (['steady', '1'], '--out', ['.json', '.csv'], 'FILE.toml')}


@pytest.mark.parametrize('name', OUT)
def test_a_name_that_promises_another_format_is_refused_with_those_possible(name, tmp_path, capfd):
    before, old, endings, possible = OUT[name]
    for option in dict.fromkeys(['--out', old]):
        for ending in endings:
            assert programs.start(name, [*before, option, str(tmp_path / f'x{ending}')]) == 2
            assert f'x{ending}": give {possible}' in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(('kind', 'ending'), [('csv', 'csv'), ('json', 'json'), ('octave', 'mat'), ('parquet', 'parquet')])
def test_exported_rows_have_the_ending_of_their_format(kind, ending, run, tmp_path, capfd):
    assert programs.start('report', [f'--{kind}', str(run), '--out', str(tmp_path / 'rows.html')]) == 2
    assert f'give FILE.{ending}' in capfd.readouterr().err
    assert list(tmp_path.glob('rows*')) == []


@pytest.fixture
def work(run, tmp_path):
    """Starts a program at its work, with plotly.js for its page."""
    script = tmp_path / 'plotly' / 'package_data' / 'plotly.min.js'
    script.parent.mkdir(parents=True)
    script.write_text('/* plotly.js */')
    (tmp_path / 'plotly' / '__init__.py').touch()

    def start(name, before):
        arguments = [argument.format(run=run, out=tmp_path) for argument in WORK[name]]
        return started(name, arguments, f'sys.path.insert(0, {str(tmp_path)!r})\n{before}', folder=tmp_path)
    return start


@pytest.mark.parametrize(('package', 'name'), [(package, name) for package, names in NEEDED.items() for name in names])
def test_a_missing_package_is_named_with_the_command(package, name, work):
    says_what_to_do(work(name, HIDES.format(package=package)), name, package)


@pytest.mark.parametrize('name', ['export-fmu', 'python_host'])
def test_some_need_no_package_at_all(name, work):
    ended = work(name, ''.join(HIDES.format(package=package) for package in NEEDED))
    assert ended.returncode == (2 if name == 'python_host' else 0), ended.stderr


@pytest.mark.parametrize('kind', BROKEN)
@pytest.mark.parametrize(('name', 'package'), [('report', 'pandas'), ('report', 'jinja2'), ('identify', 'scipy'),
                                               ('tune', 'scipy'), ('serve', 'aiohttp'), ('watch', 'rich'), ('convert', 'mcap')])
def test_packages_that_do_not_fit_are_named_with_the_command(name, package, kind, work, tmp_path):
    broken = tmp_path / 'lib' / 'site-packages' / package
    broken.mkdir(parents=True)
    (broken / '__init__.py').write_text(BROKEN[kind] + '\n')
    says_what_to_do(work(name, f'sys.path.insert(0, {str(broken.parent)!r})'), name, package)
