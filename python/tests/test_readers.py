"""Every reader takes every writer's file, as docs/readers.csv says; the files are made by the real tools."""
import csv
import datetime
import gzip
import json
import pathlib
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import ABS_HIL

import abs_hil
from abs_hil import log as log_program
from abs_hil.identification.logs import load_log
from abs_hil.interchange import recorded as convert_program
from abs_hil.report import program as report_program
from abs_hil.run import COLUMNS
from abs_hil.serve.feed import Feed, Played
from abs_hil.serve.runs import PLACE, History

pytest.importorskip('mcap')
pytest.importorskip('pyarrow')
lcm = pytest.importorskip('lcm')
ROOT = pathlib.Path(__file__).parents[2]
#: 100 cycles a second: recorded by lcm-logger in seconds
RUN = ('--fast', '--no-lcm', '--set', 'control.rate_Hz=100', '--set', 'experiment.start_speed_rad_s=170')


def table():
    """{(writer, reader): cell} of the page."""
    with open(ROOT / 'docs' / 'readers.csv', newline='') as file:
        return {(row['file'], reader): cell for row in csv.DictReader(file) for reader, cell in row.items() if reader != 'file'}


def run_of(*arguments):
    subprocess.run([ABS_HIL, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def saved_by_spreadsheet(text, separator=',', decimal='.', quote='', mark=b'\xef\xbb\xbf', encoding='utf-8'):
    """The CSV with another separator and decimal mark, quoted texts, CRLF, a byte order mark and empty rows at its end."""
    lines = []
    for number, line in enumerate(text.strip().split('\n')):
        fields = [f'{quote}{one}{quote}' if number == 0 or not re.match(r'[-+]?\d', one) else
                  (f'"{one.replace(".", decimal)}"' if decimal == separator and '.' in one else one.replace('.', decimal))
                  for one in line.split(',')]
        lines.append(separator.join(fields))
    lines += [separator * text.split('\n')[0].count(',')] * 2
    return mark + ('\r\n'.join(lines) + '\r\n').encode(encoding)


@pytest.fixture(scope='session')
def made(tmp_path_factory):
    """{writer: (file, [true columns of each of its runs])}"""
    place = tmp_path_factory.mktemp('made')
    run_of(*RUN, '--csv', place / 'a.csv', '--log', place / 'a.lcmlog', '--summary', place / 'a.json')
    run_of(*RUN, '--csv', place / 'b.csv', '--log', place / 'b.lcmlog', '--controller', 'pi')
    run_of(*RUN, '--log', place / 'c.lcmlog', '--controller', 'pi', '--set', 'telemetry.channel_prefix=RIG2_')
    run_of(*RUN, '--out', place / 'folder')
    record = subprocess.run(
        [ROOT / 'scripts' / 'in_private_network.sh', sys.executable, pathlib.Path(__file__).with_name('lcm_recordings.py'), place,
         'logger.lcmlog=a.lcmlog', 'appended.lcmlog=a.lcmlog', 'appended.lcmlog>>b.lcmlog', 'two.lcmlog=a.lcmlog,b.lcmlog',
         'rigs.lcmlog=a.lcmlog+c.lcmlog'], check=False, capture_output=True, text=True) if shutil.which('lcm-logger') else None
    if record is None or record.returncode == 77:
        pytest.skip('needs lcm-logger and network namespaces')
    assert record.returncode == 0, record.stderr
    log = (place / 'a.lcmlog').read_bytes()
    (place / 'cut.lcmlog').write_bytes(log[:len(log) * 9 // 10])
    foreign = lcm.EventLog(str(place / 'foreign.lcmlog'), 'w', overwrite=True)
    for number in range(50):
        foreign.write_event(1_600_000_000_000_000 + number * 20_000, 'CAMERA', bytes(200))
    foreign.close()
    text = (place / 'a.csv').read_text()
    (place / 'saved.csv').write_bytes(saved_by_spreadsheet(text, ';', ',', '"'))
    for ending in ('csv', 'mcap', 'parquet'):
        run_of('convert', place / 'a.lcmlog', place / f'converted.{ending}')
    a, b = (abs_hil.load(place / name).columns for name in ('a.csv', 'b.csv'))
    cut = {name: values[:len(abs_hil.load(place / 'cut.lcmlog'))] for name, values in a.items()}
    assert 200 < len(cut['time_s']) < len(a['time_s'])
    first = next(event.channel for event in lcm.EventLog(str(place / 'rigs.lcmlog')))
    return {name: (place / file, runs) for name, file, runs in (
        ('run folder', 'folder', [a]), ('event log of --log', 'a.lcmlog', [a]), ('event log of lcm-logger', 'logger.lcmlog', [a]),
        ('event log of lcm-logger --append', 'appended.lcmlog', [a, b]), ('two runs after one another', 'two.lcmlog', [a, b]),
        ('two rigs at once', 'rigs.lcmlog', [a, b] if first.startswith('ABS_') else [b, a]),
        ('event log cut off', 'cut.lcmlog', [cut]), ('CSV of --csv', 'a.csv', [a]),
        ('CSV of abs_hil convert', 'converted.csv', [a]), ('CSV saved by a spreadsheet', 'saved.csv', [a]),
        ('MCAP of abs_hil convert', 'converted.mcap', [a]), ('Parquet of abs_hil convert', 'converted.parquet', [a]),
        ("somebody else's event log", 'foreign.lcmlog', []))}


# ---- the readers: each returns columns of every run that it reads, or raises ValueError with what it says

def by_load(name, _):
    return [abs_hil.load(name).columns]


def by_program(main, arguments, capsys):
    capsys.readouterr()
    status = main([*map(str, arguments)])
    said = capsys.readouterr()
    if status != 0:
        assert status == 2, said.err
        raise ValueError(said.err)
    return said.out


def by_report(name, tools):
    """The figures of merit, which the report computes of the rows, and the rows that it exports."""
    out, figures = tools['folder'] / 'rows.csv', tools['folder'] / 'figures.csv'
    by_program(report_program.main, [name, '--table', '--merits', figures, '--force'], tools['capsys'])
    by_program(report_program.main, [name, '--csv', '--output', out, '--force'], tools['capsys'])
    import pandas
    rows, merits = pandas.read_csv(out, float_precision='round_trip'), pandas.read_csv(figures)
    runs = [{one: part[one].to_numpy() for one in part.columns if one != 'run'} for _, part in rows.groupby('run', sort=False)]
    assert merits['run'].tolist() == list(dict.fromkeys(rows['run']))
    for run, stop_s in zip(runs, merits['stop_time_s']):
        first = run['time_s'][run['phase'] == 'brake'][0]
        slow = (run['time_s'] > first) & (0.099 * run['omega2_rad_s'] < 0.3)
        assert stop_s == pytest.approx(run['time_s'][slow][0] - first, abs=1e-9) if slow.any() else np.isnan(stop_s)
    return runs


def by_convert(name, tools):
    """To each kind of file, and back."""
    runs = []
    for ending in ('csv', 'mcap', 'parquet'):
        out = tools['folder'] / f'again.{ending}'
        by_program(convert_program.main, [name, out], tools['capsys'])
        runs.append(abs_hil.load(out).columns)
    for other in runs[1:]:
        same(other, runs[0])
    return runs[:1]


def by_identify(name, _):
    log = load_log(name)
    counts = log.counts + log.first_counts
    return [{'time_s': log.time_s, 'upper_counts': counts[:, 0], 'lower_counts': counts[:, 1], 'brake_pwm': log.brake_pwm}]


def by_serve(name, _):
    history = History()
    feed, played = Feed(history, ''), Played(str(name), 0)
    while packets := played.waiting():
        feed.take(packets)
    rows = [history.rows_of(run, 0, np.inf, 10_000) for run in feed.runs]
    assert feed.damaged == 0
    return [{one: table[:, PLACE[one]] for one in ('time_s', 'omega1_est_rad_s', 'upper_counts')} for table in rows]


def by_replay(name, tools):
    out = tools['folder'] / 'replayed.csv'
    for arguments in (['--csv', out], ['--check']):
        done = subprocess.run([ABS_HIL, 'replay', name, *arguments], check=False, capture_output=True, text=True)
        if done.returncode == 2:
            raise ValueError(done.stderr)
        assert done.returncode == 0, done.stdout + done.stderr
    return [abs_hil.load(out).columns]


def by_log_info(name, tools):
    told, = json.loads(by_program(log_program.main, ['info', '--json', name], tools['capsys']))
    return [{'rows': run['rows']} for run in told['runs']]


READERS = {'report': by_report, 'load': by_load, 'convert': by_convert, 'identify': by_identify, 'serve': by_serve,
           'replay': by_replay, 'log info': by_log_info}


def same(found, true):
    if 'rows' in found:
        assert found['rows'] == len(true['time_s'])
        return
    assert len(found) >= 3
    for name, values in found.items():
        if name in true and name in COLUMNS:
            if true[name].dtype == object:
                assert list(values) == list(true[name]), name
            else:
                np.testing.assert_array_equal(np.asarray(values, dtype=float), true[name], err_msg=name)


@pytest.fixture
def tools(tmp_path, capsys):
    return {'folder': tmp_path, 'capsys': capsys}


#: what refusals say, by the letter in the table
REFUSALS = {'a': 'not an LCM event log; give a .lcmlog, as --log', 'b': 'holds no '}


@pytest.mark.parametrize(('writer', 'reader'), table())
def test_each_cell_of_the_table(made, tools, writer, reader):
    (file, runs), read, cell = made[writer], READERS[reader], table()[writer, reader]
    if cell == 'yes':
        found = read(file, tools)
        assert len(found) == len(runs)
        for one, true in zip(found, runs):
            same(one, true)
    elif cell == '#2':
        words = "holds 2 runs: give .*#1' for the first, .*#2' for the second; `abs_hil log info"
        with pytest.raises(ValueError, match=words) as refused:
            read(file, tools)
        assert str(file) in str(refused.value)
        for number, true in enumerate(runs, 1):
            found, = read(f'{file}#{number}', tools)
            same(found, true)
        with pytest.raises(ValueError, match='has no run 3, it holds 2'):
            read(f'{file}#3', tools)
    else:
        with pytest.raises(ValueError, match=re.escape(REFUSALS[cell])) as refused:
            read(file, tools)
        assert str(file) in str(refused.value)


def test_the_table_has_every_writer_and_reader(made):
    assert {writer for writer, _ in table()} == {*made} and {reader for _, reader in table()} == {*READERS}


# ---- abs_hil log info, compared with readers that are not ours

def info(file, tools):
    return json.loads(by_program(log_program.main, ['info', '--json', file], tools['capsys']))[0]


def channels_by_lcm(file):
    """{channel: (messages, bytes, first and last time in us)}, and all times, by LCM's own module."""
    found = {}
    for event in lcm.EventLog(str(file)):
        entry = found.setdefault(event.channel, [])
        entry.append((event.timestamp, len(event.data)))
    return found


@pytest.mark.parametrize(('writer', 'parts'), [
    ('event log of --log', 1), ('event log of lcm-logger', 1), ('event log of lcm-logger --append', 2),
    ('two runs after one another', 1), ('two rigs at once', 1), ('event log cut off', 1), ("somebody else's event log", 1)])
def test_log_info_says_of_a_log_what_lcms_own_module_finds(made, tools, writer, parts):
    file, runs = made[writer]
    told, found = info(file, tools), channels_by_lcm(file)
    assert (told['format'], told['bytes'], told['parts']) == ('LCM event log', file.stat().st_size, parts)
    assert {one['channel'] for one in told['channels']} == {*found}
    for one in told['channels']:
        events = found[one['channel']]
        assert (one['messages'], one['bytes']) == (len(events), sum(size for _, size in events))
        assert one['lost'] == (0 if one['type'] else None)
        if len(runs) <= 1 and len(events) > 1:
            assert one['rate_Hz'] == pytest.approx((len(events) - 1) / (events[-1][0] - events[0][0]) * 1e6)
    times = [time_us for events in found.values() for time_us, _ in events]
    assert told['duration_s'] == pytest.approx((max(times) - min(times)) * 1e-6)
    assert (told['damage'] is not None) == ('cut' in writer)
    virtual = file.name in ('a.lcmlog', 'cut.lcmlog')
    start = datetime.datetime.fromtimestamp(min(times) * 1e-6, datetime.UTC).isoformat(timespec='milliseconds')
    assert told['start_utc'] == (None if virtual else start)
    assert [run['rows'] for run in told['runs']] == [len(run['time_s']) for run in runs]
    for run, true in zip(told['runs'], runs):
        controller = 'adaptive' if 'I_m' in true else 'pi'
        assert (run['experiment'], run['controller'], run['plant'], run['backend']) == ('paper', controller, 'paper-table1', 'sim')
        ended = ('completed', 'experiment ran to its end') if 'cut' not in writer else (None, None)
        assert (run['result'], run['reason']) == ended and run['gaps'] == []


def test_log_info_says_of_mcap_and_parquet_what_their_own_packages_find(made, tools):
    import pyarrow.parquet
    from mcap.reader import make_reader
    file, _ = made['MCAP of abs_hil convert']
    with open(file, 'rb') as stream:
        summary = make_reader(stream).get_summary()
    told = info(file, tools)
    assert {one['channel']: one['messages'] for one in told['channels']} == {
        channel.topic: summary.statistics.channel_message_counts[number] for number, channel in summary.channels.items()}
    assert {one['type'] for one in told['channels']} == {schema.name for schema in summary.schemas.values()}
    span_ns = summary.statistics.message_end_time - summary.statistics.message_start_time
    assert told['duration_s'] == pytest.approx(span_ns * 1e-9)
    file, _ = made['Parquet of abs_hil convert']
    table = pyarrow.parquet.read_table(file)
    told = info(file, tools)
    assert told['format'] == 'Parquet file' and told['runs'][0]['rows'] == table.num_rows
    assert told['duration_s'] == pytest.approx(table['time_s'][-1].as_py() - table['time_s'][0].as_py())
    for kind in ('MCAP', 'Parquet'):
        run = info(made[f'{kind} of abs_hil convert'][0], tools)['runs'][0]
        assert (run['controller'], run['result'], run['gaps']) == ('adaptive', 'completed', [])


@pytest.mark.parametrize('writer', ['run folder', 'CSV of --csv', 'CSV of abs_hil convert', 'CSV saved by a spreadsheet'])
def test_log_info_of_tables_and_folders(made, tools, writer):
    file, (true,) = made[writer]
    run, = info(file, tools)['runs']
    assert run['rows'] == len(true['time_s']) and run['duration_s'] == pytest.approx(true['time_s'][-1])
    assert run['phases'] == ['brake', 'hold', 'stopped']
    assert run['result'] == ('completed' if writer == 'run folder' else None)
    text = by_program(log_program.main, ['info', file], tools['capsys'])
    assert str(file) in text and f'{run["rows"]} rows, {run["duration_s"]:.3f} s' in text


def test_log_info_counts_what_is_lost(made, tools):
    """Without every tenth message of telemetry, and with a run that begins in its middle."""
    file = tools['folder'] / 'lossy.lcmlog'
    events = [event for event in lcm.EventLog(str(made['event log of lcm-logger'][0]))]
    log = lcm.EventLog(str(file), 'w', overwrite=True)
    cycles = 0
    for event in events:
        cycles += event.channel == 'ABS_TELEMETRY'
        if event.channel != 'ABS_TELEMETRY' or (cycles > 100 and cycles % 10):
            log.write_event(event.timestamp, event.channel, event.data)
    log.close()
    told = info(file, tools)
    lost = len(range(110, cycles, 10))  # the last one of all is no gap
    assert next(one['lost'] for one in told['channels'] if one['channel'] == 'ABS_TELEMETRY') == lost
    run, = told['runs']
    assert f'{lost} messages of telemetry are missing in the log' in run['gaps']
    with pytest.raises(ValueError, match='a replay needs the run from its first cycle'):
        by_replay(file, tools)


def test_what_is_no_recording_is_an_error_that_says_what_to_do(made, tools):
    folder, log = tools['folder'], made['event log of --log'][0].read_bytes()
    for name, content, words in (
            ('empty', b'', 'the file is empty: nothing was recorded'), ('empty.lcmlog', b'', 'the file is empty'),
            ('text.lcmlog', b'hello', 'is no recording'),
            ('program', pathlib.Path(ABS_HIL).read_bytes()[:4000], 'is no recording'),
            ('log.gz', gzip.compress(log), 'is compressed: decompress it first (gunzip)'),
            ('head.lcmlog', log[:20], 'cut off within'), ('sheet.csv', b'PK\x03\x04' + bytes(99), 'save the table as CSV'),
            ('list.csv', b'name,age\nA,3\n', 'no column of a run'),
            ('cut.parquet', made['Parquet of abs_hil convert'][0].read_bytes()[:5000], 'cut off or damaged'),
            ('cut.mcap', made['MCAP of abs_hil convert'][0].read_bytes()[:500], 'cut off or damaged')):
        file = folder / name
        file.write_bytes(content)
        for read in (by_load, by_log_info, by_report, by_convert, by_identify, by_serve):
            if (read, name) == (by_log_info, 'cut.mcap'):
                continue  # says what is left of it
            says = 'lacks' if (read, name) == (by_identify, 'list.csv') else re.escape(words)
            with pytest.raises(ValueError, match=says) as refused:
                read(file, tools)
            assert str(file) in str(refused.value) and str(refused.value).count('\n') <= 1
    with pytest.raises(ValueError, match='nowhere" does not exist; give a run folder'):
        by_log_info(folder / 'nowhere', tools)


def test_a_cut_mcap_file_is_read_as_far_as_it_goes(made, tools):
    file, (true,) = made['MCAP of abs_hil convert']
    data = file.read_bytes()
    cut = tools['folder'] / 'cut.mcap'
    cut.write_bytes(data[:-60])
    run = abs_hil.load(cut)
    assert any('cut off or damaged' in note for note in run.notes) and info(cut, tools)['damage']
    same(run.columns, true)
