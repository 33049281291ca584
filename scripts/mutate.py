#!/usr/bin/env python3
"""usage: mutate.py [--list] [--jobs N] [--only FILE] [--report FILE]

Mutation run of the cycle, the command gate, its plausibility checks and limits, of what values weaken them, of the guard of a
board, and of the node's core (firmware/). The script changes one place at a time in their sources (a relation, an
operator, a constant, a condition, a statement left out), compiles only that file or, for a header, the source that uses it, without
optimisation, links it with the tests of its group and runs them. A mutant that the tests do not notice survives.
mutate_equivalent.txt must list each survivor with the reason why it changes nothing. Status 1 if a survivor is not
listed or a listed mutant is killed.

The run takes some minutes and needs the libraries of build/release. Start it on demand. Summary: docs/reference/quality.md.
"""
import argparse
import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
LIBRARIES = ROOT / 'build/release/src'


class Group:
    """Sources that are tested by the same tests."""

    def __init__(self, room, sources, tests, headers, unchanged=(), libraries=(), folders=None,
                 top='src', suffix='.cpp'):
        self.sources, self.headers = sources, headers
        self.unchanged = [ROOT / 'src' / name for name in unchanged]
        self.tests = [path for test in tests for path in sorted((ROOT / 'tests').glob(test))]
        self.libraries = [LIBRARIES / name / f'libabs_hil_{name}.a' for name in libraries]
        self.paths = {name: ROOT / top / (folders or {}).get(name, room) / f'{name}{suffix}' for name in sources}


GATE = Group('runtime',
             ['command_gate', 'run_latch', 'speed_window', 'encoder_check', 'response_check', 'plausibility_limits',
              'safety_class'],
             ['runtime/gate/*_test.cpp'],
             ('<algorithm>', '<array>', '<atomic>', '<cmath>', '<utility>', '"abs_hil/rig/brake_map.hpp"',
              '"abs_hil/rig/command.hpp"', '"abs_hil/rig/measurement.hpp"', '"abs_hil/rig/scalar.hpp"',
              '"rig/encoder_scale.hpp"', '"runtime/plausibility_limits.hpp"'),
             folders={'safety_class': 'rig'})
GUARD = Group('guardian', ['board_guard', 'watchdog', 'standby'],
              ['guardian/board_guard_test.cpp', 'guardian/guard_*_test.cpp', 'guardian/resident_*_test.cpp',
               'guardian/standby_test.cpp', 'guardian/watchdog_test.cpp'],
              ('<algorithm>', '<array>', '<atomic>', '<optional>', '<utility>', '"abs_hil/driver/safe_state_writer.hpp"',
               '"guardian/mail.hpp"', '"guardian/shared_region.hpp"', '"runtime/clock.hpp"'),
              unchanged=('guardian/linux_process.cpp', 'guardian/mail.cpp', 'guardian/shared_region.cpp'),
              libraries=('files', 'runtime', 'driver', 'rig'))
EXECUTIVE = Group('runtime', ['cyclic_executive'],
                  ['runtime/cyclic_executive_test.cpp', 'runtime/executive_duties_test.cpp', 'runtime/overrun_test.cpp',
                   'runtime/taken_back_test.cpp'],
                  ('<algorithm>', '<atomic>', '<utility>', '"abs_hil/driver/rig_driver.hpp"', '"runtime/clock.hpp"',
                   '"runtime/command_gate.hpp"', '"runtime/cycle_statistics.hpp"', '"runtime/spsc_ring.hpp"'),
                  unchanged=('driver/rig_driver.cpp', 'rig/safety_class.cpp',
                             *(f'runtime/{name}.cpp' for name in ('clock', 'command_gate', 'cycle_statistics', 'encoder_check', 'heartbeat',
                                                                  'plausibility_limits', 'record_pump', 'response_check',
                                                                  'run_latch', 'speed_window'))))
NODE = Group('', ['node_core'], ['firmware/node_*_test.cpp'], ('<stdint.h>',), top='firmware', suffix='.c')
# File -> its group and the sources that are compiled for its mutants. Of the header of the gate and of constructors in
# headers the tests have their own copies: they cannot be tried like this.
FILES = {f'{name}.cpp': (group, [name]) for group in (GATE, GUARD, EXECUTIVE) for name in group.sources} | {
    'speed_window.hpp': (GATE, ['speed_window', 'encoder_check', 'response_check']),
    'node_core.c': (NODE, ['node_core']), 'wheel_watch.hpp': (GATE, ['encoder_check']), 'response_check.hpp': (GATE, ['response_check'])}
COMPILE = ['g++', '-std=c++20', '-O0', '-fPIC', '-I', ROOT / 'include', '-I', ROOT / 'src', '-I', ROOT / 'tests', '-I',
           ROOT / 'firmware']

RELATIONS = {'<=': ['<', '>'], '>=': ['>', '<'], '<': ['<=', '>='], '>': ['>=', '<='], '==': ['!='], '!=': ['==']}
ARITHMETIC = {'+': '-', '-': '+', '*': '/', '/': '*'}

# (file, the line's text, the change) -> why no test can detect it. From EQUIVALENT_FILE.
EQUIVALENT_FILE = ROOT / 'scripts' / 'mutate_equivalent.txt'


def path_of(name):
    group, sources = FILES[name]
    return group.paths[sources[0]].with_name(name)


def code_of(text):
    """The text with comments and strings blanked out, same length."""
    blank = lambda match: re.sub(r'[^\n]', ' ', match.group())
    text = re.sub(r'//[^\n]*', blank, text)
    text = re.sub(r'/\*.*?\*/', lambda match: re.sub(r'[^\n]', ' ', match.group()), text, flags=re.DOTALL)
    return re.sub(r'"(?:\\.|[^"\\])*"', blank, text)


def mutants_of(name):
    """Yields (line number, what, mutated text)."""
    text = path_of(name).read_text()
    code = code_of(text)
    in_c = 'namespace abs_hil::' not in code
    begin = code.index('enum') if in_c else code.index('namespace abs_hil::')

    def at(start, end, new, what):
        line = text.count('\n', 0, start) + 1
        return line, what, text[:start] + new + text[end:]

    for match in re.finditer(r'(?<![<>=!&|+*/-])(<=|>=|==|!=|<|>)(?![<>=])', code):
        start, end = match.span()
        if start < begin or code[start - 1] != ' ' or code[end] != ' ':  # templates and arrows
            continue
        for new in RELATIONS[match.group()]:
            yield at(start, end, new, f'{match.group()} -> {new}')
    for match in re.finditer(r' ([-+*/]) ', code):
        start, end = match.span(1)
        if start >= begin:
            yield at(start, end, ARITHMETIC[match.group(1)], f'{match.group(1)} -> {ARITHMETIC[match.group(1)]}')
    for match in re.finditer(r' ([-+*])= ', code):
        start, end = match.span(1)
        if start >= begin:
            yield at(start, end + 1, '=', f'{match.group(1)}= -> =')
            new = '-' if match.group(1) == '+' else '+'
            yield at(start, end, new, f'{match.group(1)}= -> {new}=')
    for match in re.finditer(r'\+\+', code):
        start, end = match.span()
        if start >= begin and 'for (' not in text[text.rfind('\n', 0, start):start]:
            yield at(start, end, '', '++ left out')
    if in_c:  # masks, addresses and bounds are hexadecimal or end with U
        for match in re.finditer(r'(?<!\w)(0x[0-9A-F]+U?|\d+U)(?!\w)', code):
            start, end = match.span()
            value = int(match.group().rstrip('U'), 0)
            for new in (2 * value & 0xFFFFFFFF, 0) if start >= begin and value else ():
                yield at(start, end, f'{new}U', f'{match.group()} -> {new:#x}')
    for match in re.finditer(r"(?<![\w.'])(\d+(?:'\d+)*(?:\.\d+)?(?:e-?\d+)?)(?![\w.'])", code):
        start, end = match.span()
        line_text = text[text.rfind('\n', 0, start) + 1:text.find('\n', end)]
        if start < begin or 'std::uint64_t' in line_text or 'size_t i' in line_text:
            continue
        value = match.group().replace("'", '')
        if text[start - 1] == '{' and float(value) == 0:  # a member that is set before it is read, or begins at rest
            continue
        if float(value) == 0:
            yield at(start, end, '1' if '.' not in value else '1.0', f'{value} -> 1')
        else:
            for factor in (1.1, 0.9) if '.' in value or 'e' in value else (2, 0):
                new = repr(float(value) * factor) if '.' in value or 'e' in value else str(int(float(value) * factor))
                yield at(start, end, new, f'{value} -> {new}')
    for match in re.finditer(r'&&|\|\|', code):
        start, end = match.span()
        if start >= begin:
            new = '||' if match.group() == '&&' else '&&'
            yield at(start, end, new, f'{match.group()} -> {new}')
    for match in re.finditer(r'(?<=[\s(])!(?=[\w(])', code):
        start, end = match.span()
        if start >= begin:
            yield at(start, end, '', '! left out')
    for match in re.finditer(r'(?<!\{)\b(true|false)\b', code):
        start, end = match.span()
        if start >= begin:
            yield at(start, end, {'true': 'false', 'false': 'true'}[match.group()], f'{match.group()} turned round')
    other = {'min': 'max', 'max': 'min', 'smaller': 'larger', 'larger': 'smaller'}
    for match in re.finditer(r'(?:std|rig)::(min|max|smaller|larger)\(', code):
        start, end = match.span(1)
        if start >= begin:
            new = other[match.group(1)]
            yield at(start, end, new, f'{match.group(1)} -> {new}')
    # A condition that is always or never true.
    for match in re.finditer(r'\bif \(', code):
        depth, end = 1, match.end()
        while depth:
            depth += {'(': 1, ')': -1}.get(code[end], 0)
            end += 1
        inside = text[match.end():end - 1]
        if match.start() < begin:
            continue
        for new in ('true', 'false'):
            if ';' in inside:  # with an initialiser
                head, _ = inside.rsplit(';', 1)
                yield at(match.end(), end - 1, f'{head}; {new}', f'if ({new})')
            else:
                yield at(match.end(), end - 1, new, f'if ({new})')
    # A statement left out: assignments and calls that stand alone in their lines.
    for match in re.finditer(r'^( +)([\w.\[\]>:-]+(?: [-+*]?= [^;{}]*|\([^;{}]*\)));$', code, re.MULTILINE):
        if match.start() >= begin and not re.match(r'\s*(return|const|using|case)\b', match.group()):
            yield at(match.start(2), match.end(), ';', 'left out')


def run_quietly(*command, **options):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, errors='replace', **options)


def require(result):
    if result.returncode:
        sys.exit(result.stderr or result.stdout)


class Bench:
    """The tests as one program and the tested code as a shared object. A mutant then costs one short compilation, with
    precompiled headers, and one short link."""

    def __init__(self, folder, group):
        self.folder = folder
        self.group = group
        folder.mkdir()
        # None of FILES may be among these: a mutated header has to be read anew.
        (folder / 'headers.hpp').write_text(''.join(f'#include {header}\n' for header in group.headers))
        require(run_quietly(*COMPILE, '-w', '-x', 'c++-header', folder / 'headers.hpp', '-o',
                            folder / 'headers.hpp.gch'))
        self.objects = {name: folder / f'{name}.o' for name in group.sources}
        for name, target in self.objects.items():
            require(self.compile(group.paths[name], target))
        self.rest = []
        for source in group.unchanged:
            self.rest.append(folder / f'{source.stem}.o')
            require(self.compile(source, self.rest[-1]))
        self.rest += group.libraries
        self.place = folder / 'base'
        self.place.mkdir()
        require(self.link(self.objects.values(), self.place))
        tests = []
        for source in group.tests:
            tests.append(folder / f'{source.stem}.o')
            require(run_quietly(*COMPILE, '-w', '-c', source, '-o', tests[-1]))
        self.program = folder / 'tests'
        require(run_quietly('g++', '-o', self.program, *tests, f'-L{self.place}', '-lmutant', '-lCatch2WithMain',
                            *self.rest, *(['-lfmt', '-lsystemd'] if self.rest else [])))
        start = time.monotonic()
        if self.run(self.place, 600) != 0:
            sys.exit('the tests fail without any mutation')
        self.patience_s = 5 + 10 * (time.monotonic() - start)  # a mutant may loop for ever

    def compile(self, source, target, *includes):
        return run_quietly(*COMPILE[:4], *(f'-I{folder}' for folder in includes), *COMPILE[4:], '-w', '-include',
                           self.folder / 'headers.hpp', '-c', source, '-o', target)

    def link(self, objects, place):
        # The library calls its own functions of the headers, not those that the tests have compiled too.
        return run_quietly('g++', '-shared', '-Wl,-Bsymbolic', '-o', place / 'libmutant.so', *objects, *self.rest)

    def run(self, place, patience_s):
        try:
            return run_quietly(self.program, '-a', timeout=patience_s, env={'LD_LIBRARY_PATH': str(place)}).returncode
        except subprocess.TimeoutExpired:
            return 1

    def verdict(self, number, name, mutated):
        place = self.folder / str(number)
        place.mkdir()
        try:
            room = path_of(name).parent.name
            (place / room).mkdir()
            (place / room / name).write_text(mutated)
            objects = dict(self.objects)
            for source in FILES[name][1]:
                objects[source] = place / f'{source}.o'
                path = self.group.paths[source]
                changed = place / room / path.name
                if self.compile(changed if changed.exists() else path, objects[source], place).returncode:
                    return 'not compilable'
            # Of functions in headers the linker takes the first: the mutated ones.
            if self.link(sorted(objects.values(), key=lambda path: path.parent != place), place).returncode:
                return 'not compilable'
            return 'killed' if self.run(place, self.patience_s) else 'survived'
        finally:
            shutil.rmtree(place)


def equivalents():
    """(file, line's text, what) -> reason."""
    known = {}
    for line in EQUIVALENT_FILE.read_text().splitlines():
        if line and not line.startswith('#'):
            file, text, what, reason = (part.strip() for part in line.split('@@'))
            known[file, text, what] = reason
    return known


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--list', action='store_true', help='show the mutants and end')
    parser.add_argument('--jobs', type=int, default=max(1, (os.cpu_count() or 2) - 1))
    parser.add_argument('--only', choices=FILES)
    parser.add_argument('--report', type=pathlib.Path, help='write the counts as a Markdown table')
    arguments = parser.parse_args()
    names = [arguments.only] if arguments.only else list(FILES)
    mutants = [(name, *mutant) for name in names for mutant in mutants_of(name)]
    if arguments.list:
        for name, line, what, _ in mutants:
            print(f'{name}:{line}: {what}')
        print(len(mutants))
        return 0
    known = equivalents()
    counts = {name: {'killed': 0, 'equivalent': 0, 'survived': 0, 'not compilable': 0} for name in names}
    bad = 0
    used = set()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        groups = {FILES[name][0]: None for name in names}
        benches = {group: Bench(folder / str(i), group) for i, group in enumerate(groups)}
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            results = [(m, pool.submit(benches[FILES[m[0]][0]].verdict, i, m[0], m[3])) for i, m in enumerate(mutants)]
            for (name, line, what, _), future in results:
                result = future.result()
                text = path_of(name).read_text().splitlines()[line - 1].strip()
                key = (name, text, what)
                if result == 'survived' and key in known:
                    used.add(key)
                    result = 'equivalent'
                elif result == 'survived':
                    bad += 1
                    print(f'SURVIVED {name}:{line}: {what}: {text}', flush=True)
                counts[name][result] += 1
    for key in known:
        if key[0] in names and key not in used:
            bad += 1
            print(f'listed as equivalent, but killed or gone: {" @@ ".join(key)}')
    table = '| file | mutants | killed | equivalent | survived |\n|---|---|---|---|---|\n'
    for name in names:
        c = counts[name]
        total = c['killed'] + c['equivalent'] + c['survived']
        table += f'| `{name}` | {total} | {c["killed"]} | {c["equivalent"]} | {c["survived"]} |\n'
    print(table, end='')
    if arguments.report:
        arguments.report.write_text(table)
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
