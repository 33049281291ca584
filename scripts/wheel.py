#!/usr/bin/env python3
"""usage: wheel.py --module FILE --python 311 --platform TAG --fmu FOLDER --built FOLDER --out FOLDER

Packs a wheel of the package abs_hil: the modules in Python, the compiled module FILE, the libraries for exported FMUs, the
message types and tables of a build tree, the configuration. The same input gives the same bytes: the files are in the order
of their names, and their time is SOURCE_DATE_EPOCH.
"""
from __future__ import annotations

import argparse
import base64
import hashlib
import os
import pathlib
import re
import time
import tomllib
import zipfile

import pyproject_metadata

ROOT = pathlib.Path(__file__).resolve().parents[1]
#: what needs the compiled module that wheels lack
LEFT_OUT = {'_network.pyi'}


def version() -> str:
    found = re.search(r'project\(abs_hil VERSION ([0-9.]+)', (ROOT / 'CMakeLists.txt').read_text(encoding='utf-8'))
    assert found
    return found[1]


def files_below(folder: pathlib.Path, place: str) -> dict[str, bytes]:
    return {f'{place}/{file.relative_to(folder).as_posix()}': file.read_bytes() for file in folder.rglob('*')
            if file.is_file() and '__pycache__' not in file.parts and file.name not in LEFT_OUT}


def package(given: argparse.Namespace) -> dict[str, bytes]:
    files = files_below(ROOT / 'python' / 'abs_hil', 'abs_hil')
    files |= {f'abs_hil/serve/{name}': content for name, content in files_below(ROOT / 'third_party/uplot', 'uplot').items()}
    lab = ROOT / 'build' / 'lab' / 'abs_hil_lab.wasm'  # where scripts/lab.sh has made it
    if lab.exists():
        files[f'abs_hil/lab/{lab.name}'] = lab.read_bytes()
    tables = [*given.built.glob('*_t.py'), given.built / 'quantities.json', given.built / 'reasons.json']
    files |= {f'abs_hil/{file.name}': file.read_bytes() for file in tables}
    files |= files_below(given.fmu, 'abs_hil/fmu')
    files[f'abs_hil/{given.module.name}'] = given.module.read_bytes()
    files |= {f'abs_hil-{version()}.data/data/share/abs_hil/{name}': content
              for name, content in files_below(ROOT / 'config', 'config').items() if not name.startswith('config/udev/')}
    return files


def facts(tag: str) -> dict[str, bytes]:
    """The folder .dist-info without RECORD."""
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
    metadata = pyproject_metadata.StandardMetadata.from_pyproject(project, ROOT)
    metadata.version = pyproject_metadata.packaging.version.Version(version())
    scripts = ''.join(f'{name} = {place}\n' for name, place in sorted(project['project']['scripts'].items()))
    return {'METADATA': bytes(metadata.as_rfc822()),
            'WHEEL': f'Wheel-Version: 1.0\nGenerator: abs_hil scripts/wheel.py\nRoot-Is-Purelib: false\nTag: {tag}\n'.encode(),
            'entry_points.txt': f'[console_scripts]\n{scripts}'.encode(),
            'licenses/LICENSE': (ROOT / 'LICENSE').read_bytes()}


def record(files: dict[str, bytes], place: str) -> bytes:
    def line(name: str, content: bytes) -> str:
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b'=').decode()
        return f'{name},sha256={digest},{len(content)}\n'
    return ''.join([*(line(*row) for row in sorted(files.items())), f'{place},,\n']).encode()


def write(path: pathlib.Path, files: dict[str, bytes]) -> None:
    date = time.gmtime(int(os.environ['SOURCE_DATE_EPOCH']))[:6]
    with zipfile.ZipFile(path, 'w') as wheel:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, date)
            entry.create_system = 3
            entry.external_attr = (0o100755 if name.endswith(('.so', '.dll', '.pyd')) else 0o100644) << 16
            wheel.writestr(entry, content, zipfile.ZIP_DEFLATED, 9)


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ('--module', '--fmu', '--built', '--out'):
        p.add_argument(name, type=pathlib.Path, required=True)
    p.add_argument('--python', required=True)
    p.add_argument('--platform', required=True)
    given = p.parse_args()
    tag = f'cp{given.python}-cp{given.python}-{given.platform}'
    dist_info = f'abs_hil-{version()}.dist-info'
    files = package(given) | {f'{dist_info}/{name}': content for name, content in facts(tag).items()}
    files[f'{dist_info}/RECORD'] = record(files, f'{dist_info}/RECORD')
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / f'abs_hil-{version()}-{tag}.whl'
    write(path, files)
    print(f'{path}: {path.stat().st_size / 1e6:.1f} MB, {len(files)} files')


if __name__ == '__main__':
    main()
