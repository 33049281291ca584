"""Results of the Python programs are whole or absent, and never take the place of what is no regular file."""
import errno
import hashlib
import os
import pathlib
import re
import stat
import subprocess
import sys

import pytest

import abs_hil
from abs_hil.core import _core
from abs_hil.files import refusal, write_text, write_whole
from abs_hil.programs import _plainly

LONG = 'n' * 300


def test_a_failure_leaves_the_older_file(tmp_path):
    path = tmp_path / 'result'
    path.write_text('older')

    def fails(name):
        pathlib.Path(name).write_text('half')
        raise RuntimeError('in the middle')

    with pytest.raises(RuntimeError):
        write_whole(path, fails)
    write_whole(path, lambda name: None, probe=True)
    assert path.read_text() == 'older' and os.listdir(tmp_path) == ['result']
    write_text(path, 'new')
    assert path.read_text() == 'new' and os.listdir(tmp_path) == ['result']


@pytest.mark.skipif(not hasattr(os, 'mkfifo'), reason='Windows has no pipes and devices among its files')
def test_links_devices_and_pipes_stay_what_they_are(tmp_path):
    link, pipe, device = tmp_path / 'link', tmp_path / 'pipe', tmp_path / 'null'
    link.symlink_to('far')
    os.mkfifo(pipe)
    try:
        os.mknod(device, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    except PermissionError:
        device = pathlib.Path('/dev/null')
    run = abs_hil.simulate(set={'experiment.start_speed_rad_s': 30})
    for write in (lambda path: write_text(path, 'words'), run.to_csv):
        write(link)
        write(device)
        assert link.is_symlink() and (tmp_path / 'far').stat().st_size > 0 and device.is_char_device()
        with pytest.raises(ValueError, match='nobody reads'):
            write(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(pipe, 'through')
    assert os.read(reader, 100) == b'through' and pipe.is_fifo()
    os.close(reader)


@pytest.mark.parametrize('name', [LONG, 'd/' * 3000 + 'x', 'nowhere/x', '', '.'])
def test_bad_paths_are_named(tmp_path, name):
    with pytest.raises(ValueError, match='cannot write'):
        write_text(tmp_path / name, 'words')
    assert os.listdir(tmp_path) == []


def command(name, *words):
    """The words that start a program as pip's commands do."""
    script = f'import sys; sys.argv[0] = "/usr/bin/abs_{name}"; from abs_hil.programs import command; command()'
    return [sys.executable, '-c', script, *map(str, words)]


def test_a_changed_run_folder_is_refused_by_the_name_of_the_file(tmp_path, abs_hil_program):
    abs_hil_program('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=60', '--out', tmp_path / 'run')
    assert len(abs_hil.load(tmp_path / 'run'))
    with open(tmp_path / 'run' / 'summary.json', 'a') as file:
        file.write(' ')
    with pytest.raises(ValueError, match=r'summary\.json" is not as it was recorded'):
        abs_hil.load(tmp_path / 'run')
    report = subprocess.run(command('report', tmp_path / 'run', '--output', tmp_path / 'report.html'), capture_output=True,
                            text=True)
    assert report.returncode == 2 and 'summary.json' in report.stderr and not (tmp_path / 'report.html').exists()


def test_the_checksums_of_files_of_any_length_are_sha_256(tmp_path):
    sums = tmp_path / 'SHA256SUMS'
    names = [(f'{size}.bin', bytes(n * n % 251 for n in range(size))) for size in (*range(200), 262144, 262145)]
    lines = []
    for name, content in names:
        (tmp_path / name).write_bytes(content)
        lines.append(f'{hashlib.sha256(content).hexdigest()}  {name}\n')
    sums.write_text(''.join(lines))
    _core.check_seal(os.fsencode(tmp_path))
    (tmp_path / '119.bin').write_bytes(b'x' * 119)
    with pytest.raises(ValueError, match='119.bin'):
        _core.check_seal(os.fsencode(tmp_path))


def test_a_full_disk_behind_stdout_is_status_1(tmp_path, abs_hil_program):
    abs_hil_program('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=60', '--out', tmp_path / 'run')
    for words in (('report', '--help'), ('report', '--table', tmp_path / 'run'), ('report', '--csv', tmp_path / 'run')):
        with open('/dev/full', 'w') as full:
            result = subprocess.run(command(*words), stdout=full, stderr=subprocess.PIPE, text=True)
        assert result.returncode == 1 and 'cannot write to standard output' in result.stderr, result
        assert result.stderr.count('\n') == 1, result
    made = tmp_path / 'made'
    reports = [('report', kind, tmp_path / 'run') for kind in ('--csv', '--json', '--octave', '--table')]
    for words in (*reports, ('report', '--help'), ('rig', 'steady', '1', '--out', made), ('export-fmu', '--out', f'{made}.fmu'),
                  ('tune', '--help')):
        nobody, out = os.pipe()
        os.close(nobody)
        result = subprocess.run(command(*words), stdout=out, stderr=subprocess.PIPE, text=True)
        os.close(out)
        assert (result.returncode, result.stderr) == (0, ''), result
        assert '--out' not in ' '.join(map(str, words)) or any(tmp_path.glob('made*'))  # the work is done
        made.unlink(missing_ok=True)


@pytest.mark.parametrize('unbuffered', ['', '1'])  # '' is as if it were not set
def test_the_status_is_told_although_nobody_reads_why(tmp_path, unbuffered):
    nobody, out = os.pipe()
    os.close(nobody)
    result = subprocess.run(command('report', tmp_path / 'nowhere'), stdout=out, stderr=out,
                            env=os.environ | {'PYTHONUNBUFFERED': unbuffered})
    os.close(out)
    assert result.returncode == 2


def test_an_error_of_the_system_has_its_fix(tmp_path):
    for number, deed, words in ((errno.ENOSPC, 'write', 'free some space'), (errno.EACCES, 'read', 'ls -l'),
                                (errno.EADDRINUSE, 'reach', 'another program listens there')):
        text = refusal(OSError(number, os.strerror(number), 'the/place'), deed=deed)
        assert text.startswith(f'{os.strerror(number)}; ') and words in text
    with pytest.raises(ValueError, match='Not a directory; a part of the path is a file'):
        write_text(pathlib.Path('/dev/null/x'), 'words')


def test_a_closed_output_is_as_dev_null(tmp_path, abs_hil_program):
    abs_hil_program('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=60', '--out', tmp_path / 'run')
    for closed, words in (('>&-', ('report', '--help')), ('>&- 2>&-', ('report', '--csv', tmp_path / 'run')),
                          ('2>&-', ('report', '--table', tmp_path / 'run'))):
        result = subprocess.run(['sh', '-c', f'exec "$0" "$@" {closed}', *command(*words)], capture_output=True, text=True)
        assert (result.returncode, result.stderr) == (0, ''), result
        assert ('stop time' in result.stdout) == (closed == '2>&-')


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='needs a device without space')
def test_the_fix_of_a_full_disk_is_space(tmp_path):
    with pytest.raises(ValueError, match='No space left on device; free some space on that file system'):
        write_whole(tmp_path / 'page', lambda name: pathlib.Path('/dev/full').write_text('words'))


def test_standard_output_gets_what_its_encoding_has(tmp_path, abs_hil_program):
    run = tmp_path / 'rün'
    abs_hil_program('--fast', '--no-lcm', '--out', run)
    plain = {**os.environ, 'LC_ALL': 'C', 'PYTHONCOERCECLOCALE': '0', 'PYTHONUTF8': '0'}
    table = subprocess.run(command('report', '--table', run), capture_output=True, env=plain)
    assert table.returncode == 0 and re.search(rb'theta error at end +-0[.]', table.stdout), table
    name = 'ü'.encode().decode('ascii', 'surrogateescape')  # as such a Python has the name of a file
    assert _plainly(UnicodeEncodeError('ascii', f'{name}−θ', 0, 4, '')) == ('ü'.encode() + b'-?', 4)
