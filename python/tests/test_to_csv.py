"""The CSV files that `abs_hil convert` makes of event logs."""
import csv
import os
import pathlib
import resource
import struct
import subprocess
import sys

import pytest

import abs_hil
from abs_hil.interchange import recorded

QUICK = ('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=60')


def log_of(*events):
    """An event log of (number, time in us, channel, data)."""
    return b''.join(struct.pack('>IqqII', 0xEDA1DA01, number, time_us, len(channel), len(data)) + channel.encode() + data
                    for number, time_us, channel, data in events)


def cycle(number):
    message = abs_hil.telemetry_t()
    message.cycle = message.sequence = number
    message.time_s, message.stamp_ns, message.omega2_rad_s = number * 1e-3, number * 1_000_000, 1.0
    return message.encode()


def converted(tmp_path, log, status=0):
    (tmp_path / 'x.lcmlog').write_bytes(log)
    assert recorded.main([str(tmp_path / 'x.lcmlog'), str(tmp_path / 'made.csv')]) == status
    return {path.name: path.read_text().splitlines() for path in tmp_path.glob('made*')}


@pytest.mark.parametrize('arguments', [
    (), ('--experiment', 'pulses'), ('--inject', 'brake@read:intermittent=0.2+0.2s~0.01s'), ('--controller', 'pi'),
    ('--set', 'telemetry.channel_prefix=RIG/A_')])
def test_the_rows_are_those_of_the_run_and_each_other_channel_has_its_file(tmp_path, abs_hil_program, arguments):
    status = 1 if '--inject' in arguments else 0
    abs_hil_program(*QUICK, '--log', tmp_path / 'x.lcmlog', '--csv', tmp_path / 'own.csv', *arguments, status=status)
    made = converted(tmp_path, (tmp_path / 'x.lcmlog').read_bytes())
    own, main = (tmp_path / 'own.csv').read_text().splitlines(), made['made.csv']
    assert len(main) == len(own) > 100
    assert all(line.startswith(f'{row},') for line, row in zip(main, own))
    beyond = [name for name, row in abs_hil.QUANTITIES.items() if row['csv_column'] is None]
    assert main[0] == ','.join([own[0], *beyond, 'log_event', 'log_time_us', 'channel', 'type'])
    prefix = 'RIG_A_' if '--set' in arguments else 'ABS_'
    assert {*made} == {'made.csv', *(f'made.{prefix}{channel}.csv' for channel in ('EVENT', 'STATUS', 'EXPERIMENT'))}
    rows = list(csv.DictReader(main))
    assert [int(row['cycle']) for row in rows] == list(range(len(rows)))  # whole numbers stay whole
    assert {row['stamp_ns'].isdigit() for row in rows} == {True}
    events = list(csv.DictReader(made[f'made.{prefix}EVENT.csv']))
    assert [one['time_s'] for one in events] == sorted((one['time_s'] for one in events), key=float)
    numbers = sorted(int(row['log_event']) for table in made.values() for row in csv.DictReader(table))
    assert numbers == list(range(len(numbers)))  # each message once


def test_texts_are_quoted_where_they_need_it(tmp_path):
    event = abs_hil.event_t()
    event.kind, event.message = 'command', 'quoted "text", with comma'
    made = converted(tmp_path, log_of((0, 5, 'ABS_TELEMETRY', cycle(0)), (1, 6, 'ABS_EVENT', event.encode())))
    assert made['made.ABS_EVENT.csv'][1].endswith('command,0,0,,0,"quoted ""text"", with comma",1,6,ABS_EVENT,event_t')


def test_unknown_types_and_damaged_messages_are_kept_as_hexadecimal_digits(tmp_path, capsys):
    made = converted(tmp_path, log_of((0, 5, 'OTHER', b'\x01\x02\x03\xff'), (4, -5, 'ABS_TELEMETRY', cycle(0)),
                                      (5, 6, 'ABS_TELEMETRY', cycle(1)[:-1]), (9, 7, 'EMPTY', b'')))
    assert len(made['made.csv']) == 2
    assert made['made.raw.csv'] == ['data_hex,log_event,log_time_us,channel,type', '010203ff,0,5,OTHER,raw',
                                    f'{cycle(1)[:-1].hex()},5,6,ABS_TELEMETRY,raw', ',9,7,EMPTY,raw']
    assert '4 messages, 3 of them not of abs_hil, as hexadecimal digits' in capsys.readouterr().out


def test_channels_whose_names_make_the_same_file_name_get_files_of_their_own(tmp_path):
    status = abs_hil.status_t().encode()
    made = converted(tmp_path, log_of((0, 0, 'A_TELEMETRY', cycle(0)), *((n, n, channel, status) for n, channel in enumerate(
        ('A/B/C', 'A_B/C', 'A/B_C', 'A_B_C'), 1))))
    assert len(made) == 5 and all(len(lines) == 2 for lines in made.values())


def test_counts_of_a_hundred_thousand_are_whole_numbers(tmp_path):
    """The shortest text of the number 100000 is 1e+05; the program writes the count as one."""
    message = abs_hil.telemetry_t.decode(cycle(0))
    message.upper_counts = 100_000
    made = converted(tmp_path, log_of((0, 0, 'ABS_TELEMETRY', message.encode())))
    assert next(csv.DictReader(made['made.csv']))['upper_counts'] == '100000'
    abs_hil.load(tmp_path / 'x.lcmlog').to_csv(tmp_path / 'again.csv')
    assert next(csv.DictReader((tmp_path / 'again.csv').open()))['upper_counts'] == '100000'


def test_a_damaged_log_is_converted_up_to_its_cut_or_leaves_the_older_file(tmp_path, abs_hil_program):
    abs_hil_program(*QUICK, '--log', tmp_path / 'run.lcmlog')
    whole, folder = (tmp_path / 'run.lcmlog').read_bytes(), tmp_path / 'made'
    folder.mkdir()
    statuses = []
    for place in range(1000, len(whole), len(whole) // 40):
        for damaged in (whole[:place], whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1:]):
            (tmp_path / 'x.lcmlog').write_bytes(damaged)
            (folder / 'made.csv').write_text('older')
            statuses.append(recorded.main([str(tmp_path / 'x.lcmlog'), str(folder / 'made.csv')]))
            names = [path.name for path in folder.iterdir()]
            if statuses[-1] == 0:
                assert len((folder / 'made.csv').read_text().splitlines()) > 1
                for path in folder.iterdir():
                    path.unlink()
            else:
                assert statuses[-1] == 2 and names == ['made.csv'] and (folder / 'made.csv').read_text() == 'older'
    assert statuses.count(0) > 20


@pytest.mark.parametrize('most', [50_000, 300_000])
def test_a_full_disk_leaves_the_older_file_and_is_status_1(tmp_path, abs_hil_program, most):
    abs_hil_program(*QUICK, '--log', tmp_path / 'run.lcmlog')
    (tmp_path / 'made.csv').write_text('older')
    code = 'import sys; from abs_hil.interchange import recorded; sys.exit(recorded.main(sys.argv[1:]))'
    done = subprocess.run([sys.executable, '-c', code, tmp_path / 'run.lcmlog', tmp_path / 'made.csv'], capture_output=True,
                          text=True, env=dict(os.environ),
                          preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)))
    assert done.returncode == 1 and 'made.csv' in done.stderr, done.stderr
    assert (tmp_path / 'made.csv').read_text() == 'older'
    assert {path.name for path in tmp_path.iterdir()} == {'run.lcmlog', 'made.csv'}


def test_what_the_command_reads_is_not_replaced(tmp_path, abs_hil_program, capsys):
    abs_hil_program(*QUICK, '--out', tmp_path / 'run')
    before = {path: path.read_bytes() for path in (tmp_path / 'run').iterdir()}
    run = tmp_path / 'run'
    for origin, out in ((run, run / 'run.csv'), (run / 'run.csv', run / 'run.csv'), (run, tmp_path / 'no' / 'x.csv'),
                        (run, tmp_path / 'x.txt')):
        assert recorded.main([str(origin), str(out)]) == 2
        assert str(out) in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (tmp_path / 'run').iterdir()} == before
    assert not pathlib.Path(tmp_path / 'no').exists()


def test_as_users_run_it(tmp_path, abs_hil_program):
    log, out = tmp_path / 'run.lcmlog', tmp_path / 'made.csv'
    abs_hil_program(*QUICK, '--log', log, '--out', tmp_path / 'run')
    whole = log.read_bytes()
    assert abs_hil_program('convert', log, out).stdout.endswith('; lost: nothing\n')
    log.write_bytes(whole[:-5])
    assert 'lost: parts of the log are not used: ' in abs_hil_program('convert', log, out).stdout
    log.write_bytes(whole + whole)
    assert f"'{log}' holds 2 runs: give '{log}#1' for the first" in abs_hil_program('convert', log, out, status=2).stderr
    assert abs_hil_program('log', 'info', log).stdout.count('completed: experiment ran to its end') == 2
    log.write_bytes(b'')
    assert f'{log}: the file is empty' in abs_hil_program('convert', log, out, status=2).stderr
    with open(tmp_path / 'run' / 'run.lcmlog', 'ab') as file:
        file.write(b'x')
    assert 'is not as it was recorded' in abs_hil_program('convert', tmp_path / 'run', out, status=2).stderr
    assert abs_hil_program('log', 'info', tmp_path / 'nowhere', log, status=2).stderr.count('\n') == 2
