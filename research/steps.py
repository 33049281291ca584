"""The steps of research/reproduce.py: the rows of steps.toml, what they depend on, and how their results are kept or compared."""
from __future__ import annotations

import dataclasses
import difflib
import hashlib
import importlib.util
import pathlib
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable

from claim.guard import differences, replaced

#: what a row may need besides the release build, and how it is got
NEEDS = {'casadi': 'scripts/setup_python.sh', 'gymnasium': 'scripts/setup_python.sh',
         'chromium': 'scripts/setup.sh packages-report.txt'}
#: what a row may use: files below the root and below the build
USES = {'program': ('bin/abs_hil_program', 'config/**/*.toml'),
        'package': ('share/abs_hil/python/abs_hil/*.so', 'python/abs_hil/**/*.py', 'config/**/*.toml'),
        'optimum': ('python/abs_hil/optimum/*.py', 'python/abs_hil/benchmark/bounds.py', 'python/abs_hil/benchmark/cases.py',
                    'config/plants/*.toml')}
#: lines of a file that differs
SHOWN = 20
MARK = re.compile(r'^<!-- (?:begin )?(?!end)([\w ]+) -->\n(.*?)^<!-- end', re.MULTILINE | re.DOTALL)


@dataclasses.dataclass(frozen=True)
class Step:
    """A row. Its command says how its results reach the pages:
    {mode} is --write or --check: the program itself keeps what it makes;
    {out} is a folder: files below it belong at the same place below the root;
    {kept} is a folder that stays as long as the optimum's code does, {own} one that stays as long as the inputs do;
    with neither it prints the table of the mark that it makes, or, without a mark, sentences of that page, one a line: their
    numbers are kept. A row that makes nothing is a check alone."""
    name: str
    run: str
    makes: tuple[str, ...] = ()  #: files, or file#mark for a table of a page
    uses: tuple[str, ...] = ()  #: of USES
    inputs: tuple[str, ...] = ()  #: patterns of other files
    after: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()  #: of NEEDS
    cpu_s: float = 0.0  #: user and system time, as measured
    parallel: bool = False  #: the command uses {jobs} processors by itself
    tolerance: float | None = None  #: of the numbers, relative; without it the text must be the same
    presence: str = ''  #: why the results are only looked for, not compared
    by_hand: str = ''  #: date of the last time, and why it is not run with the others

    def manner(self) -> str:
        return next((word for word in ('mode', 'out') if f'{{{word}}}' in self.run), 'prints')


def rows(path: pathlib.Path) -> dict[str, Step]:
    """In order of their dependencies. Raises ValueError for a row that names what there is not."""
    read = {name: Step(name, **{key: tuple(value) if isinstance(value, list) else value for key, value in row.items()})
            for name, row in tomllib.loads(path.read_text(encoding='utf-8')).items()}
    for step in read.values():
        for what, known in ((step.after, read), (step.uses, USES), (step.needs, NEEDS)):
            if unknown := set(what) - set(known):
                raise ValueError(f'{path.name}: {step.name} names {", ".join(sorted(unknown))}; there are {", ".join(known)}')
    ordered: dict[str, Step] = {}
    while len(ordered) < len(read):
        ready = {name: step for name, step in read.items() if name not in ordered and set(step.after) <= set(ordered)}
        if not ready:
            raise ValueError(f'{path.name}: these wait for each other: {", ".join(set(read) - set(ordered))}')
        ordered.update(ready)
    return ordered


def marks(text: str) -> dict[str, str]:
    """Mark -> the table between its lines."""
    return {name: table for name, table in MARK.findall(text)}


def _imported(script: pathlib.Path, known: set[pathlib.Path]) -> None:
    """Adds the script, and those of its folder and of scripts/ that it imports."""
    known.add(script)
    if script.suffix != '.py':
        return
    for name in re.findall(r'^\s*(?:from|import) (\w+)', script.read_text(encoding='utf-8'), re.MULTILINE):
        for folder in (script.parent, script.parents[1] / 'scripts'):
            found = folder / f'{name}.py'
            if found.exists() and found not in known:
                _imported(found, known)


class Place:
    """A tree and a build: where steps read and write."""

    def __init__(self, root: pathlib.Path, build: pathlib.Path, state: pathlib.Path) -> None:
        self.root, self.build, self.state = root, build, state
        own = root / 'build/python/bin/python'
        self.python = own if own.exists() else pathlib.Path(sys.executable)
        self._digests: dict[pathlib.Path, str] = {}

    def words(self, step: Step, mode: str, jobs: int) -> list[str]:
        values = {'python': self.python, 'build': self.build, 'mode': mode, 'jobs': jobs, 'out': self.state / 'out' / step.name,
                  'kept': self.state / 'kept' / self._hash(self.files(USES['optimum'])),
                  'own': self.state / 'own' / f'{step.name}-{self._hash(self.inputs(step))}'}
        for name in ('kept', 'own'):
            if f'{{{name}}}' in step.run:
                values[name].mkdir(parents=True, exist_ok=True)
        return [word.format(**values) for word in step.run.split()]

    def _digest(self, path: pathlib.Path) -> str:
        if path not in self._digests:
            self._digests[path] = hashlib.sha256(path.read_bytes()).hexdigest()
        return self._digests[path]

    def _hash(self, files: list[pathlib.Path]) -> str:
        return hashlib.sha256(' '.join(f'{path.name} {self._digest(path)}' for path in files).encode()).hexdigest()[:16]

    def files(self, patterns: Iterable[str]) -> list[pathlib.Path]:
        return sorted({path for pattern in patterns for folder in (self.root, self.build) for path in folder.glob(pattern)
                       if path.is_file()})

    def inputs(self, step: Step) -> list[pathlib.Path]:
        """The scripts that the command names and their imports, what the row uses, and its other files."""
        files: set[pathlib.Path] = set()
        for word in step.run.split():
            if (self.root / word).is_file():
                _imported(self.root / word, files)
        files.update(self.files([*step.inputs, *(pattern for name in step.uses for pattern in USES[name])]))
        made = {self.root / name for name in step.makes}
        return sorted(files - made)

    def text(self, made: str) -> str | bytes:
        """What stands in the tree now: the table of file#mark, or the whole file. '' where there is none."""
        file, _, mark = made.partition('#')
        path = self.root / file
        if not path.exists():
            return ''
        if mark:
            return marks(path.read_text(encoding='utf-8')).get(mark, '')
        return path.read_bytes()

    def key(self, step: Step, mode: str) -> str:
        """Of all that the result of a step depends on, and of what the pages have now."""
        whole = hashlib.sha256(f'{step.run} {step.tolerance} {mode} {self._hash(self.inputs(step))}'.encode())
        for made in step.makes:
            text = self.text(made)
            whole.update(text if isinstance(text, bytes) else text.encode())
        return whole.hexdigest()

    def lacks(self, step: Step) -> str:
        """What a step needs and this computer has not, with the fix; '' if all is there."""
        for name in step.needs:
            module = name not in ('chromium',)
            there = self._imports(name) if module else shutil.which(name)
            if not there:
                return f'{name} ({NEEDS[name]})'
        return ''

    def _imports(self, module: str) -> bool:
        if self.python == pathlib.Path(sys.executable):
            return importlib.util.find_spec(module) is not None
        return subprocess.run([self.python, '-c', f'import {module}'], capture_output=True).returncode == 0

    def settle(self, step: Step, mode: str, printed: str) -> list[str]:
        """Writes or compares what a step that ended well has made. Returns what differs, each with its page first."""
        if step.manner() == 'mode' or not step.makes:
            return []
        if step.manner() == 'prints':
            file = step.makes[0].partition('#')[0]
            fresh = {file: self._printed_page(step, printed)}
        else:
            out = self.state / 'out' / step.name
            fresh = {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob('*')) if path.is_file()}
            if missing := [made for made in step.makes if made.partition('#')[0] not in fresh]:
                return [f'{made}: the step has not made it' for made in missing]
        if mode == '--write':
            for name, content in fresh.items():
                (self.root / name).parent.mkdir(parents=True, exist_ok=True)
                (self.root / name).write_bytes(content)
            return []
        return [line for name, content in fresh.items() for line in self._compared(step, name, content)]

    def _printed_page(self, step: Step, printed: str) -> bytes:
        """The page with the printed table, or with the numbers of the printed sentences."""
        file, _, mark = step.makes[0].partition('#')
        page = (self.root / file).read_text(encoding='utf-8')
        if not mark:
            return replaced(page, [], [line for line in printed.splitlines() if line]).encode()
        if mark not in marks(page):
            raise ValueError(f'{file}: the line <!-- {mark} --> is missing, or its <!-- end -->')
        lines = re.compile(rf'^(<!-- {re.escape(mark)} -->\n).*?^(<!-- end -->)$', re.MULTILINE | re.DOTALL)
        return lines.sub(lambda found: found[1] + printed + found[2], page).encode()

    def _compared(self, step: Step, name: str, fresh: bytes) -> list[str]:
        path = self.root / name
        if not path.exists():
            return [f'{name}: this file is missing']
        if step.presence or path.read_bytes() == fresh:
            return []
        if b'\0' in fresh:
            return [f'{name}: the file differs']
        before, now = path.read_text(encoding='utf-8'), fresh.decode()
        if step.tolerance is None:
            changed = difflib.unified_diff(before.splitlines(), now.splitlines(), lineterm='', n=0)
            found = [line for line in changed if line[:3] not in ('---', '+++', '@@ ')][:SHOWN]
        else:
            found = differences(before, now, step.tolerance)
        return [f'{name}: {line}' for line in found]
