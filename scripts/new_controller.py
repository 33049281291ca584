#!/usr/bin/env python3
"""usage: new_controller.sh [--no-build] NAME | --out DIR NAME

Adds the controller NAME, for example my-law, to this tree: a pair of files in src/control with the keys of its gains,
control.my_law.*, its first test, the line of the registry, the lines of both CMakeLists.txt and the row of
docs/controllers.md. Then builds abs_hil and the test, runs the test, and renews what lists all controllers. The new law
is the proportional one of docs/writing-a-controller.md under its new name; replace it by yours.

--out DIR writes a project of its own instead, a copy of examples/own_controller under the new name.
"""
import argparse
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / 'tests' / 'example_controller'
OWN_PROJECT = ROOT / 'examples' / 'own_controller'


def refuse(why):
    sys.exit(print(f'new_controller.sh: {why}', file=sys.stderr) or 2)


class Names:
    def __init__(self, name):
        if not re.fullmatch(r'[a-z][a-z0-9]*(-[a-z0-9]+)*', name) or len(name) > 40:
            refuse(f'"{name}": give a name of lower-case words, as in my-law, at most 40 characters')
        self.name = name
        self.section = name.replace('-', '_')
        self.file = self.section + '_controller'
        self.stem = ''.join(word.capitalize() for word in name.split('-'))

    def renamed(self, text):
        """The example's text under the new name."""
        text = text.replace('Proportional', self.stem).replace('proportional_controller', self.file)
        text = text.replace('control.proportional.', f'control.{self.section}.')
        return text.replace('"proportional"', f'"{self.name}"')


def changed(path, change):
    text = path.read_text(encoding='utf-8')
    new = change(text)
    if new == text:
        refuse(f'{path.relative_to(ROOT)}: the place for the new line is gone; see docs/writing-a-controller.md')
    path.write_text(new, encoding='utf-8')
    print(f'changed {path.relative_to(ROOT)}')


def add_sorted(line, like):
    """Adds a line among those that match `like`, in alphabetical order."""
    def change(text):
        lines = text.split('\n')
        places = [n for n, other in enumerate(lines) if re.fullmatch(like, other)]
        if not places:
            return text
        at = next((n for n in places if lines[n] > line), places[-1] + 1)
        return '\n'.join([*lines[:at], line, *lines[at:]])
    return change


def in_tree(names):
    room, tests = ROOT / 'src' / 'control', ROOT / 'tests' / 'control'
    new = {
        room / f'{names.file}.hpp': (EXAMPLE / 'proportional_controller.hpp'),
        room / f'{names.file}.cpp': (EXAMPLE / 'proportional_controller.cpp'),
        tests / f'{names.file}_test.cpp': (EXAMPLE / 'promises_test.cpp'),
    }
    registry = room / 'registry.cpp'
    if f'"{names.name}"' in registry.read_text(encoding='utf-8'):
        refuse(f'there is a controller {names.name} already')
    options = ROOT / 'include' / 'abs_hil' / 'control' / 'options.hpp'
    if f'"{names.section}."' in options.read_text(encoding='utf-8'):
        refuse(f'there are keys control.{names.section}.* already; give another name')
    for path in new:
        if path.exists():
            refuse(f'{path.relative_to(ROOT)} exists already')
    for path, example in new.items():
        text = names.renamed(example.read_text(encoding='utf-8'))
        text = text.replace('namespace example', 'namespace abs_hil::control').replace('example::', 'control::')
        text = text.replace(f'"{names.file}.hpp"', f'"control/{names.file}.hpp"')
        text = text.replace('using namespace abs_hil;\n\n' + names.stem, names.stem)
        if path.parent == room:
            text = re.sub(r'(?<![\w:])control::', '', text.replace('abs_hil::control::', '').replace('abs_hil::rig::', 'rig::'))
        else:
            text = (f'// The first test of {names.name}: what every slip controller promises. Add what your law promises.\n\n'
                    + text[text.index('#include'):])
        path.write_text(text, encoding='utf-8')
        print(f'wrote {path.relative_to(ROOT)}')
    changed(registry, add_sorted(f'#include "control/{names.file}.hpp"', r'#include "control/.*"'))
    entry = f'    controller_entry<{names.stem}Controller>("{names.name}", "torque proportional to the slip error"),\n'
    changed(registry, lambda text: re.sub(r'(own_table\{\n(?:.*\n)*?)(\};)', lambda m: m[1] + entry + m[2], text, count=1))
    changed(room / 'CMakeLists.txt', add_sorted(f'    {names.file}.cpp', r'    \w+\.cpp'))
    test = names.file.removesuffix('_controller')
    changed(tests / 'CMakeLists.txt',
            lambda text: text + f'\nabs_hil_test(control_{test} SOURCES {names.file}_test.cpp USES abs_hil::control)\n')
    row = f'| `{names.name}` | Tb = base + gain (λref − λ) | nothing | λref | |\n'
    changed(ROOT / 'docs' / 'controllers.md',
            lambda text: re.sub(r'(\| name \| law .*\n(?:\|.*\n)+)', lambda m: m[1] + row, text, count=1))
    formatter = shutil.which('clang-format-16')
    if formatter:
        subprocess.run([formatter, '-i', *new, registry], check=True)
    return f'test_control_{test}'


def build(test):
    run = lambda *command, **how: subprocess.run(command, cwd=ROOT, check=True, **how)
    run('scripts/setup.sh', 'packages-tests.txt')
    run('scripts/build.sh', 'release', '--target', 'abs_hil_executable', test)
    program = ROOT / 'build' / 'release' / 'bin' / 'abs_hil'
    run(ROOT / 'build' / 'release' / 'tests' / test)
    schema = run(program, 'validate', '--schema', capture_output=True, text=True).stdout
    (ROOT / 'config' / 'experiments' / 'schema.json').write_text(schema, encoding='utf-8')
    run(sys.executable, 'research/model_mismatch.py', '--write')
    print('renewed config/experiments/schema.json and docs/reference/model-mismatch.csv')


def out_of_tree(names, folder):
    if folder.exists() and any(folder.iterdir()):
        refuse(f'{folder} is not empty; give a new folder')
    folder.mkdir(parents=True, exist_ok=True)
    for source in sorted(OWN_PROJECT.iterdir()):
        text = names.renamed(source.read_text(encoding='utf-8')).replace('--controller proportional', f'--controller {names.name}')
        (folder / source.name).write_text(text, encoding='utf-8')
        print(f'wrote {folder / source.name}')
    print(f'''Build it against an installation of abs_hil, then run it:
  cmake -G Ninja -S {folder} -B {folder}/build -DCMAKE_PREFIX_PATH=PREFIX
  cmake --build {folder}/build && ctest --test-dir {folder}/build
  {folder}/build/my_abs_hil compare --controllers adaptive,{names.name}''')


def main():
    parser = argparse.ArgumentParser(prog='new_controller.sh', description=__doc__.split('\n\n', 1)[1],
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('name', metavar='NAME')
    parser.add_argument('--out', metavar='DIR', type=pathlib.Path, help='write a project of its own into DIR')
    parser.add_argument('--no-build', action='store_true', help='write the files only')
    arguments = parser.parse_args()
    names = Names(arguments.name)
    if arguments.out:
        return out_of_tree(names, arguments.out)
    test = in_tree(names)
    if not arguments.no_build:
        try:
            build(test)
        except subprocess.CalledProcessError as error:
            sys.exit(f'new_controller.sh: {error}')
    print(f'''{names.name} is ready. Its gains are keys:
  build/release/bin/abs_hil compare --controllers 'adaptive,{names.name},{names.name}{{gain_Nm=20}}'
Change its law in src/control/{names.file}.cpp, then
  scripts/build.sh release --target abs_hil_executable {test} && build/release/tests/{test}
Python and reports know it after scripts/build.sh release --target abs_hil_python''')


if __name__ == '__main__':
    main()
