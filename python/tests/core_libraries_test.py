#!/usr/bin/env python3
"""usage: core_libraries_test.py MODULE

The compiled module abs_hil._core is the simulation core: it needs no library of a network, a guardian or a terminal, and
no other that wheels could not bring. fmt, spdlog and toml++ are header-only there.
"""
import re
import subprocess
import sys

ALLOWED = {'libc', 'libm', 'libgcc_s', 'libstdc++', 'ld-linux-x86-64', 'ld-linux-aarch64', 'libpthread', 'libdl', 'libz',
           'libfmt', 'libspdlog', 'libtomlplusplus'}


def main():
    text = subprocess.run(['readelf', '-d', sys.argv[1]], capture_output=True, text=True, check=True).stdout
    needed = re.findall(r'\(NEEDED\).*\[(.*)\]', text)
    assert needed, text
    strangers = [name for name in needed if name.split('.so')[0] not in ALLOWED]
    print('_core needs', ', '.join(strangers) or 'no stranger', 'among', len(needed), 'libraries')
    return 1 if strangers else 0


if __name__ == '__main__':
    sys.exit(main())
