#!/usr/bin/env python3
"""Fails when a room includes what it must never know (docs/architecture.md, "Rooms").

usage: check_includes.py ROOT              checks ROOT/include/abs_hil and ROOT/src, and that the document's table is this
       check_includes.py ROOT --self-test  plants one offence per rule in a copy and checks that each is found
"""
import pathlib
import re
import shutil
import sys
import tempfile

# room -> the rooms whose headers it may include, itself aside
MAY_KNOW = {
    'rig': set(),
    'control': {'rig'},
    'plant_sim': {'rig'},
    'driver': {'rig'},
    'driver/sim': {'rig', 'driver', 'plant_sim'},
    'emulator': {'rig', 'plant_sim'},
    'runtime': {'rig', 'driver'},
    'guardian': {'rig', 'driver', 'runtime'},
    'experiment': {'rig', 'control', 'driver', 'runtime'},
    'telemetry': {'rig', 'lcmtypes'},
    'watch': {'rig', 'telemetry', 'lcmtypes'},
    'analysis': {'rig'},
    'archive': set(),
    'report': {'rig', 'plant_sim', 'analysis'},
    'diagnosis': {'rig', 'driver', 'runtime', 'telemetry'},
    'settings': {'rig', 'control', 'plant_sim', 'driver', 'runtime', 'guardian', 'experiment'},
    'app': {'control'},  # the program's public face; the program itself, apps/, knows everything
    'steering': {'rig', 'control', 'runtime', 'experiment', 'settings', 'telemetry', 'lcmtypes'},
    'replay': {'rig', 'control', 'driver', 'driver/sim', 'runtime', 'experiment', 'script', 'settings', 'telemetry', 'lcmtypes'},
    'script': {'rig', 'experiment', 'settings'},
    'comparison': {'rig', 'script', 'control', 'plant_sim', 'driver', 'driver/sim', 'runtime', 'experiment', 'analysis', 'settings'},
}
# room -> libraries that are none of its business
NEVER_INCLUDES = {
    'rig': r'^(lcm|spdlog|boost|nlohmann|toml\+\+|CLI|fmt)/',
    'control': r'^(lcm|spdlog|boost|nlohmann|toml\+\+|CLI|fmt|fstream|chrono|thread|ctime|time\.h|filesystem|iostream)',
    'plant_sim': r'^(lcm|spdlog|nlohmann|toml\+\+|CLI|fstream|chrono|thread)',
    'driver': r'^(lcm|spdlog|nlohmann|toml\+\+|CLI)/',
    'driver/sim': r'^(lcm|spdlog|nlohmann|toml\+\+|CLI)/',
    'emulator': r'^(lcm|spdlog|nlohmann|toml\+\+|CLI)/',
    'runtime': r'^(lcm|boost|nlohmann|toml\+\+|CLI)/',
    'guardian': r'^(lcm|spdlog|boost|toml\+\+|CLI)/',
    'experiment': r'^(lcm|boost|CLI)/',
    'report': r'^(lcm|spdlog|boost|CLI)/',
    'comparison': r'^(lcm|spdlog|boost|CLI)/',
}
ROW = re.compile(r'^\| `([a-z_/]+)` \|.*\| ([^|]+) \|$', re.MULTILINE)
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def room_of(relative):
    """Room of a path below include/abs_hil or src; None for what belongs to none."""
    parts = relative.parts
    if len(parts) < 2:
        generated = relative.name.endswith('_t.hpp') or relative.name == 'message_fields.hpp'
        return 'lcmtypes' if generated else None
    deeper = '/'.join(parts[:2])
    return deeper if deeper in MAY_KNOW else parts[0]


def offences(root):
    found = []
    for base in (root / 'include' / 'abs_hil', root / 'src'):
        for file in sorted(base.rglob('*.[ch]pp')):
            room = room_of(file.relative_to(base))
            if room not in MAY_KNOW:
                found.append(f'{file}: room "{room}" is not in the table of rooms')
                continue
            for number, line in enumerate(file.read_text().splitlines(), 1):
                include = INCLUDE.match(line)
                if not include:
                    continue
                name = include.group(1)
                if name.startswith('abs_hil/'):
                    other = room_of(pathlib.Path(name[len('abs_hil/'):]))
                    if other != room and other not in MAY_KNOW[room]:
                        found.append(f'{file}:{number}: room {room} must not know {other}: {name}')
                elif room in NEVER_INCLUDES and re.match(NEVER_INCLUDES[room], name):
                    found.append(f'{file}:{number}: room {room} must not know the library {name}')
    return found


def documented_otherwise(text):
    """Where the table of docs/architecture.md says something else than MAY_KNOW."""
    table = {room: set() if known == 'nothing' else set(known.split(', ')) for room, known in ROW.findall(text)}
    if table.pop('apps', None) != {'everything'}:
        table['apps'] = {'not everything'}
    return [f'docs/architecture.md: room {room} may know {sorted(table.get(room, ["(no such room)"]))}, '
            f'not {sorted(MAY_KNOW.get(room, ["(no such room)"]))}'
            for room in sorted(table.keys() | MAY_KNOW.keys()) if table.get(room) != MAY_KNOW.get(room)]


def self_test(root):
    """Every forbidden pair of rooms must be found when it is planted."""
    missed = []
    for room, known in MAY_KNOW.items():
        for other in MAY_KNOW:
            if other == room or other in known or (room == 'driver/sim' and other == 'driver'):
                continue
            with tempfile.TemporaryDirectory() as copy:
                tree = pathlib.Path(copy)
                place = tree / 'src' / room
                place.mkdir(parents=True)
                (tree / 'include' / 'abs_hil').mkdir(parents=True)
                (place / 'planted.cpp').write_text(f'#include "abs_hil/{other}/anything.hpp"\n')
                if len(offences(tree)) != 1:
                    missed.append(f'{room} including {other}')
    with tempfile.TemporaryDirectory() as copy:
        tree = pathlib.Path(copy) / 'tree'
        shutil.copytree(root / 'src', tree / 'src')
        shutil.copytree(root / 'include', tree / 'include')
        (tree / 'src' / 'control' / 'planted.cpp').write_text('#include <chrono>\n')
        if not any('planted.cpp:1' in offence for offence in offences(tree)):
            missed.append('control including <chrono>')
    table = (root / 'docs' / 'architecture.md').read_text()
    for row in ROW.finditer(table):
        for changed in (table.replace(row[0], ''), table.replace(row[0], row[0].replace(f'| {row[2]} |', '| other |'))):
            if len(documented_otherwise(changed)) != 1:
                missed.append(f'docs/architecture.md without or with another row of {row[1]}')
    return missed


def main():
    root = pathlib.Path(sys.argv[1])
    if '--self-test' in sys.argv:
        problems = [f'planted offence not found: {missed}' for missed in self_test(root)]
    else:
        problems = offences(root) + documented_otherwise((root / 'docs' / 'architecture.md').read_text())
    print('\n'.join(problems) or 'no room knows more than it may, and the document says so')
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
