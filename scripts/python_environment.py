"""For setup_python.sh, so that Debian's Python packages and those of PyPI fit each other. Needs Python alone.

python_environment.py constraints         prints, for pip, the version of each Python package in scripts/packages*.txt: of
                                          the one that is installed, otherwise of the one that apt would install
python_environment.py problems PYTHON FILE    with the environment's Python: prints why it does not work, and ends with status 1.
                                          PYTHON is the one outside of it, FILE the constraints
"""
import ast
import importlib
import importlib.metadata
import pathlib
import re
import subprocess
import sys
import sysconfig

ROOT = pathlib.Path(__file__).resolve().parents[1]
#: what dpkg looks after; /usr/local and ~/.local stand before it in Python's path
DEBIAN = pathlib.Path('/usr/lib/python3/dist-packages')


def plain(name: str) -> str:
    return re.sub(r'[-_.]+', '-', name).lower()


def versions(*folders: object) -> dict[str, str]:
    found = importlib.metadata.distributions(path=[str(folder) for folder in folders])
    return {plain(one.metadata['Name']): one.version for one in found if one.metadata['Name']}


def constraints() -> dict[str, str]:
    lists = ''.join(path.read_text() for path in ROOT.glob('scripts/packages*.txt'))
    wanted = sorted({*re.findall(r'^python3-([a-z0-9.-]+)', lists, re.MULTILINE)} - {'dev', 'venv'})
    known = versions(DEBIAN) if DEBIAN.is_dir() else versions(*sys.path)
    fixed = {name: known[name] for name in wanted if name in known}
    lacking = [f'python3-{name}' for name in wanted if name not in fixed]
    try:
        said = subprocess.run(['apt-cache', 'policy', *lacking], capture_output=True, text=True, check=True,
                              env={'LC_ALL': 'C', 'PATH': '/usr/bin:/bin'}).stdout
    except (OSError, subprocess.CalledProcessError):
        return fixed  # no Debian
    for name, version in re.findall(r'^python3-(\S+):\n.*\n  Candidate: (?:\d+:)?(\d[^-+~\s]*)', said, re.MULTILINE):
        fixed[name] = version
    return fixed


def imported() -> list[str]:
    """The modules of others that our package imports."""
    names = set()
    for path in ROOT.glob('python/abs_hil/**/*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names.update(one.name for one in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names.add(str(node.module))
    return sorted(name for name in names if name.partition('.')[0] not in {*sys.stdlib_module_names, 'abs_hil', '__future__'})


def checked(*options: str) -> set[str]:
    return {*subprocess.run([sys.executable, '-m', 'pip', *options, 'check'], capture_output=True, text=True).stdout.splitlines()}


def problems(python: str, fixed: dict[str, str]) -> list[str]:
    own = versions(sysconfig.get_path('purelib'), sysconfig.get_path('platlib'))
    found = [f'{name} {own[name]} is there beside packages of Debian that fit {name} {version}'
             for name, version in fixed.items() if own.get(name, version) != version]
    found += sorted(checked() - checked('--python', python) - {'No broken requirements found.'})
    for name in imported():
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name != name.partition('.')[0]:  # otherwise it is not installed: no program needs all of them
                found.append(f'import {name}: {error}')
        except Exception as error:  # what a module for another version of NumPy raises
            found.append(f'import {name}: {type(error).__name__}: {error}')
    return found


if __name__ == '__main__':
    if sys.argv[1] == 'constraints':
        print('\n'.join(f'{name}=={version}' for name, version in constraints().items()))
    else:
        lines = pathlib.Path(sys.argv[3]).read_text().split()
        said = problems(sys.argv[2], dict(line.split('==') for line in lines))
        print(''.join(f'setup: {one}\n' for one in said), end='')
        sys.exit(bool(said))
