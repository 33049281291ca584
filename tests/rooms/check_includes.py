#!/usr/bin/env python3
"""Fails if a file includes a header that its room must not use.

The compiler already refuses headers of rooms that a room does not list (cmake/Room.cmake). This check finds what the
compiler cannot find: includes of the backend `driver/sim`, which is in the folder of `driver`; of libraries that a room
does not link; of clocks, threads and files in rooms that only compute; of private headers in public ones; of what a driver
knows about its board in the emulators' program, which has to know it by itself.

usage: check_includes.py ROOT ROOMS.TSV              checks include/abs_hil, src and extras of ROOT
       check_includes.py ROOT ROOMS.TSV --self-test  plants one offence of each kind and checks that each is found
"""
import pathlib
import re
import sys
import tempfile

# A header of a library -> what links it in the CMakeLists.txt of a room
LIBRARIES = {
    r'lcm/': 'lcmtypes', r'spdlog/': 'spdlog::spdlog', r'boost/': 'Boost::headers', r'nlohmann/': 'nlohmann_json',
    r'toml\+\+/': 'tomlplusplus', r'CLI/': 'CLI11', r'fmt/': 'fmt::fmt', r'openssl/': 'OpenSSL',
    r'Eigen/': 'Eigen3',
}
# Rooms that compute and never look at a clock, a thread, a file or a terminal
PURE = {'rig', 'control', 'plant_sim'}
# What the emulators' program may have of the drivers: nothing about a board
OF_DRIVERS = {'driver/file_descriptor.hpp', 'driver/monotonic_time.hpp'}
EXTRAS = {folder.name for folder in (pathlib.Path(__file__).resolve().parents[2] / 'extras').iterdir()}
IMPURE_HEADER = re.compile(r'^(chrono|ctime|time\.h|thread|mutex|fstream|iostream|filesystem|unistd\.h|fcntl\.h|sys/.*)$')
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def read_rooms(table):
    rows = [line.split('\t') for line in table.read_text().splitlines()[1:]]
    return {row[0]: set(row[2].split()) for row in rows}


def room_of(relative):
    """Room of a path below include/abs_hil, src or extras."""
    return 'driver_sim' if relative.parts[:2] == ('driver', 'sim') else relative.parts[0]


def room_of_include(name, rooms):
    """Room of an included header of ours; None for all others."""
    parts = pathlib.Path(name).parts
    if parts[0] == 'abs_hil':
        return 'lcmtypes' if len(parts) == 2 else room_of(pathlib.Path(*parts[1:]))
    return room_of(pathlib.Path(name)) if len(parts) > 1 and parts[0] in rooms else None


def linked_by(root, room):
    """What the room's CMakeLists.txt says, to look for names of libraries in it."""
    name = 'driver' if room == 'driver_sim' else room
    files = [root / top / name / 'CMakeLists.txt' for top in ('src', 'extras')]
    return next((file.read_text() for file in files if file.exists()), '')


def offences(root, rooms):
    found = []
    for base in (root / 'include' / 'abs_hil', root / 'src', root / 'extras'):
        for file in sorted(base.rglob('*.[ch]pp')):
            room = room_of(file.relative_to(base))
            if file.relative_to(base).parts[1].startswith('abs_'):
                continue  # a program of an extra, which uses what programs use
            if room not in rooms:
                found.append(f'{file}: room "{room}" is not in cmake/Rooms.cmake')
                continue
            for number, line in enumerate(file.read_text().splitlines(), 1):
                include = INCLUDE.match(line)
                if not include:
                    continue
                name, place = include.group(1), f'{file}:{number}'
                other = room_of_include(name, rooms)
                if other is None:
                    library = next((links for begin, links in LIBRARIES.items() if re.match(begin, name)), None)
                    known = 'lcmtypes' in rooms[room] if library == 'lcmtypes' else library in linked_by(root, room) if library else True
                    if not known:
                        found.append(f'{place}: room {room} does not link {library}: {name}')
                    if room in PURE and IMPURE_HEADER.match(name):
                        found.append(f'{place}: room {room} only computes, it must not include {name}')
                elif other != room and other not in rooms[room]:
                    found.append(f'{place}: room {room} must not know {other}: {name}')
                elif base.name == 'abs_hil' and not name.startswith('abs_hil/'):
                    found.append(f'{place}: a public header must not need a private one: {name}')
    for file in sorted((root / 'extras/emulator/abs_rig_emulator').rglob('*.[ch]pp')):
        names = re.findall(r'^#include "((?:abs_hil/)?driver/[^"]+)"', file.read_text(), re.MULTILINE)
        found += [f'{file}: an emulator must know its board by itself: {name}' for name in names if name not in OF_DRIVERS]
    return found


def self_test(rooms):
    """Plants every kind of offence. Returns those that the check does not find."""
    planted = [(f'{"extras" if room in EXTRAS else "src"}/{"driver/sim" if room == "driver_sim" else room}', f'{other}/anything.hpp')
               for room, known in rooms.items() for other in rooms
               if other != room and other not in known and other not in ('driver_sim', 'lcmtypes')]
    planted += [('src/experiment', 'driver/sim/sim_driver.hpp'), ('src/control', 'chrono'), ('src/control', 'fmt/format.h'),
                ('src/driver', 'lcm/lcm-cpp.hpp'), ('src/report', 'abs_hil/event_t.hpp'), ('src/nowhere', 'vector'),
                ('include/abs_hil/control', 'control/adaptive_gains.hpp'), ('extras/emulator/abs_rig_emulator', 'driver/pci/wire.hpp')]
    missed = []
    for folder, include in planted:
        with tempfile.TemporaryDirectory() as copy:
            tree = pathlib.Path(copy)
            (tree / folder).mkdir(parents=True)
            (tree / folder / 'planted.hpp').write_text(f'#include "{include}"\n')
            if len(offences(tree, rooms)) != 1:
                missed.append(f'{folder} including {include}')
    return missed


def main():
    root, rooms = pathlib.Path(sys.argv[1]), read_rooms(pathlib.Path(sys.argv[2]))
    if '--self-test' in sys.argv:
        problems = [f'planted offence not found: {missed}' for missed in self_test(rooms)]
    else:
        problems = offences(root, rooms)
    print('\n'.join(problems) or f'none of {len(rooms)} rooms includes a forbidden header')
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
