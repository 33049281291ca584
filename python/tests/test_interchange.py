"""Converted runs, read back with decoders that are not ours: equal to the CSV bit for bit."""
import io
import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import ABS_HIL

import abs_hil
from abs_hil.interchange import recorded, running
from abs_hil.interchange.messages import McapFile, field_names
from abs_hil.run import COLUMNS

pytest.importorskip('mcap')
FIELDS = field_names(COLUMNS)


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """A run folder with event log, of a controller with signals."""
    path = tmp_path_factory.mktemp('run') / 'run'
    subprocess.run([ABS_HIL, '--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=170', '--out', path], check=True,
                   stdout=subprocess.DEVNULL)
    return path


def converted(origin, tmp_path, name='run.mcap'):
    assert recorded.main([str(origin), str(tmp_path / name)]) == 0
    return tmp_path / name


def decoded_by_mcap_ros2(path):
    """topic -> [(time, message)]"""
    reader = pytest.importorskip('mcap.reader')
    ros2 = pytest.importorskip('mcap_ros2.decoder')
    topics = {}
    with open(path, 'rb') as file:
        for decoded in reader.make_reader(file, decoder_factories=[ros2.DecoderFactory()]).iter_decoded_messages():
            topics.setdefault(decoded.channel.topic, []).append((decoded.message.log_time, decoded.decoded_message))
    return topics


def decoded_by_rosbags(path):
    """topic -> messages, through another implementation of CDR"""
    typesys = pytest.importorskip('rosbags.typesys')
    reader = pytest.importorskip('mcap.reader')
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    topics = {}
    with open(path, 'rb') as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            if schema.name not in store.types and schema.name.startswith('abs_hil/'):
                store.register(typesys.get_types_from_msg(schema.data.decode(), schema.name))
            if schema.name.startswith('abs_hil/'):
                topics.setdefault(channel.topic, []).append(store.deserialize_cdr(message.data, schema.name))
    return topics


def bits(values):
    return np.asarray(values, dtype=np.float64).view(np.uint64)


def csv_columns(path):
    return {name: values for name, values in abs_hil.load(path).columns.items() if values.dtype != object}


@pytest.mark.parametrize('origin', ['.', 'run.csv', 'run.lcmlog'])
@pytest.mark.parametrize('decode', [decoded_by_mcap_ros2, decoded_by_rosbags])
def test_every_value_is_that_of_the_csv(folder, tmp_path, origin, decode):
    topics = decode(converted(folder / origin, tmp_path))
    expected = csv_columns(folder / 'run.csv')
    cycles = [entry[1] if isinstance(entry, tuple) else entry for entry in topics['/abs_hil/cycle']]
    assert len(cycles) == len(expected['time_s'])
    for name in COLUMNS:
        if name != 'phase':
            assert np.array_equal(bits([getattr(cycle, FIELDS[name]) for cycle in cycles]), bits(expected[name])), name
    phases = abs_hil.load(folder / 'run.csv').columns['phase']
    assert [abs_hil.PHASES[int(cycle.phase)] for cycle in cycles] == phases.tolist()
    signals = [entry[1] if isinstance(entry, tuple) else entry for entry in topics['/abs_hil/signals']]
    own = abs_hil.load(folder / 'run.csv').signals
    known = ~np.isnan(np.column_stack([expected[name] for name in own])).all(axis=1)
    assert len(own) > 0 and known.any()
    for name, field in field_names(own).items():
        assert np.array_equal(bits([getattr(row, field) for row in signals]), bits(expected[name][known])), name


def test_own_names_of_phases(tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    run = tmp_path / 'run'
    subprocess.run([ABS_HIL, '--fast', '--no-lcm', '--experiment', 'pulses', '--out', run], check=True, stdout=subprocess.DEVNULL)
    names = abs_hil.load(run).columns['phase_name'].tolist()
    path = converted(run, tmp_path)
    with open(path, 'rb') as file:
        of_numbers = next(pytest.importorskip('mcap.reader').make_reader(file).iter_metadata()).metadata['phase_names'].split(',')
    assert [of_numbers[int(cycle.phase_name)] for _, cycle in decoded_by_mcap_ros2(path)['/abs_hil/cycle']] == names
    table = parquet.read_table(converted(run, tmp_path, 'run.parquet'))
    assert table['phase_name'].to_pylist() == names
    assert 'controller' not in json.loads(table.schema.metadata[b'abs_hil.units'])['phase_name']


def test_names_of_fields():
    assert field_names(['theta_N', 'Theta_n', 'a__b_', 'I_m']) == {'theta_N': 'theta_n', 'Theta_n': 'theta_n_2', 'a__b_': 'a_b',
                                                                  'I_m': 'i_m'}


def test_times_and_events(folder, tmp_path):
    topics = decoded_by_mcap_ros2(converted(folder, tmp_path))
    times = [time_ns for time_ns, _ in topics['/abs_hil/cycle']]
    assert np.array_equal(np.diff(times), np.full(len(times) - 1, 1_000_000))
    assert abs(times[-1] / 1e9 - time.time()) < 3600
    texts = [message.msg for _, message in topics['/abs_hil/event']]
    assert len(texts) == len((folder / 'events.csv').read_text().splitlines()) - 1
    assert any('experiment ran to its end' in text for text in texts)
    log = decoded_by_mcap_ros2(converted(folder / 'run.lcmlog', tmp_path, 'log.mcap'))
    assert len(log['/abs_hil/event']) == len(texts)


def test_file_has_index_compression_attachments_and_metadata(folder, tmp_path):
    reader = pytest.importorskip('mcap.reader')
    with open(converted(folder, tmp_path), 'rb') as file:
        mcap = reader.make_reader(file)
        summary = mcap.get_summary()
        assert summary.statistics.message_count > 1000
        assert summary.chunk_indexes and {chunk.compression for chunk in summary.chunk_indexes} == {'zstd'}
        assert {channel.message_encoding for channel in summary.channels.values()} == {'cdr'}
        assert {schema.encoding for schema in summary.schemas.values()} == {'ros2msg'}
        attached = {attachment.name: attachment.data for attachment in mcap.iter_attachments()}
        metadata = {record.name: record.metadata for record in mcap.iter_metadata()}
    for name in ('config.toml', 'summary.json', 'events.csv'):
        assert attached[name] == (folder / name).read_bytes()
    assert metadata['abs_hil']['losses'] == 'none'
    assert metadata['abs_hil']['controller'] == 'adaptive'


def test_parquet(folder, tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    table = parquet.read_table(converted(folder, tmp_path, 'run.parquet'))
    for name, values in csv_columns(folder / 'run.csv').items():
        assert np.array_equal(bits(table[name].to_numpy()), bits(values)), name
    assert table['phase'].to_pylist() == abs_hil.load(folder / 'run.csv').columns['phase'].tolist()
    assert json.loads(table.schema.metadata[b'abs_hil.summary.json']) == abs_hil.load(folder).summary


def edited(folder, channel, sequences, change):
    """The event log with change(bytes) in place of some messages of a channel; None leaves one out."""
    data, made, place = (folder / 'run.lcmlog').read_bytes(), io.BytesIO(), 0
    while place < len(data):
        channel_size, data_size = struct.unpack_from('>II', data, place + 20)
        begin = place + 28 + channel_size
        message = data[begin:begin + data_size]
        if data[place + 28:begin].decode().endswith(channel) and struct.unpack_from('>q', message, 16)[0] in sequences:
            message = change(message)
        if message is not None:
            made.write(data[place:place + 24] + struct.pack('>I', len(message)) + data[place + 28:begin] + message)
        place = begin + data_size
    return made.getvalue()


@pytest.mark.parametrize('change', [lambda message: message[:-3], lambda message: b'x' + message[1:], lambda message: None])
def test_events_that_a_log_lacks_are_counted(folder, tmp_path, capsys, change):
    (tmp_path / 'run.lcmlog').write_bytes(edited(folder, 'EVENT', [1], change))
    converted(tmp_path / 'run.lcmlog', tmp_path)
    out = capsys.readouterr().out
    assert '1 events are missing in the log' in out
    assert ('1 messages of the log cannot be read' in out) == (change(b'xxxx') is not None)


def test_impossible_times_and_numbers_are_refused_with_their_place(folder, tmp_path, capsys):
    def refusal(origin):
        for name in ('run.mcap', 'run.parquet'):
            assert recorded.main([str(origin), str(tmp_path / name)]) == 2 and not (tmp_path / name).exists()
        return capsys.readouterr().err
    log, at = tmp_path / 'run.lcmlog', {'TELEMETRY': 32, 'EVENT': 24}  # of time_s
    for channel, place in (('TELEMETRY', 'message 101 of its telemetry'), ('EVENT', 'event 2')):
        for time_s in (np.nan, np.inf, 1e300, -1e300, -5.0):
            number, wrong = int(place.split()[1]) - 1, struct.pack('>d', time_s)
            log.write_bytes(edited(folder, channel, [number], lambda message, begin=at[channel], wrong=wrong:
                                   message[:begin] + wrong + message[begin + 8:]))
            assert f'run.lcmlog: {place}: time_s ' in refusal(log)
    log.write_bytes(edited(folder, 'TELEMETRY', [50], lambda message: message[:24] + b'\x80' + bytes(7) + message[32:]))
    assert 'run.lcmlog: a message has the impossible number -9223372036854775808' in refusal(log)
    csv = tmp_path / 'run.csv'
    lines = (folder / 'run.csv').read_text().splitlines()
    csv.write_text('\n'.join([*lines[:-1], '1e12' + lines[-1][lines[-1].index(','):]]) + '\n')
    assert f'run.csv:{len(lines)}: time_s = 1e+12' in refusal(csv)
    shutil.copytree(folder, tmp_path / 'run')
    (tmp_path / 'run' / 'SHA256SUMS').unlink()
    for time_s in ('1e11', '1e300', 'nan', 'x'):
        lines = (folder / 'events.csv').read_text().splitlines()
        lines[2] = time_s + lines[2][lines[2].index(','):]
        (tmp_path / 'run' / 'events.csv').write_text('\n'.join(lines) + '\n')
        assert 'events.csv:3: ' in refusal(tmp_path / 'run')


def test_a_time_that_no_stamp_can_hold_is_a_loss(folder, tmp_path, capsys):
    shutil.copytree(folder, tmp_path / 'run')
    (tmp_path / 'run' / 'SHA256SUMS').unlink()
    (tmp_path / 'run' / 'environment.json').write_text('{"date_utc": "9999-01-01T00:00:00Z"}')
    path = converted(tmp_path / 'run', tmp_path)
    assert 'the times begin at 1970-01-01' in capsys.readouterr().out
    assert decoded_by_mcap_ros2(path)['/abs_hil/cycle'][0][0] == 0


def test_lost_messages_are_counted(folder, tmp_path, capsys):
    """Without 7 messages in its middle a log has a gap, and the conversion says so."""
    kept = edited(folder, 'TELEMETRY', range(500, 507), lambda message: None)
    (tmp_path / 'gap.lcmlog').write_bytes(kept)
    converted(tmp_path / 'gap.lcmlog', tmp_path)
    assert '7 messages of telemetry are missing' in capsys.readouterr().out
    rows = (folder / 'run.csv').read_text().splitlines()
    (tmp_path / 'gap.csv').write_text('\n'.join(rows[:900] + rows[905:]) + '\n')
    converted(tmp_path / 'gap.csv', tmp_path)
    assert 'gaps in time for 5 rows' in capsys.readouterr().out
    (tmp_path / 'cut.lcmlog').write_bytes(kept[:-1000])
    converted(tmp_path / 'cut.lcmlog', tmp_path)
    assert 'lost: nothing' not in capsys.readouterr().out


def test_killed_conversion_leaves_no_file(folder, tmp_path):
    """Killed at several places, the conversion leaves the old file or none."""
    out = tmp_path / 'run.mcap'
    script = ('import os, signal, sys, abs_hil.interchange.messages as m\n'
              'from abs_hil.interchange import recorded\n'
              'calls = 0\n'
              'write = m.McapFile.{method}\n'
              'def die(*args, **kwargs):\n'
              '    global calls\n'
              '    calls += 1\n'
              '    if calls > {after}: os.kill(os.getpid(), signal.SIGKILL)\n'
              '    return write(*args, **kwargs)\n'
              'm.McapFile.{method} = die\n'
              'recorded.main(sys.argv[1:])\n')
    for method, after in (('write', 0), ('write', 1500), ('describe', 0), ('finish', 0)):
        for before in (None, b'the old one'):
            out.unlink(missing_ok=True)
            if before is not None:
                out.write_bytes(before)
            code = script.format(method=method, after=after)
            status = subprocess.run([sys.executable, '-c', code, folder, out], env=dict(os.environ)).returncode
            assert status == -signal.SIGKILL
            assert (out.read_bytes() if out.exists() else None) == before
            assert not [path for path in tmp_path.iterdir() if path.suffix == '.mcap' and path != out]


@pytest.mark.parametrize('arguments, words', [
    (['nowhere', 'out.mcap'], 'nowhere'), (['{run}', 'out.txt'], '.mcap or .parquet'), (['out.mcap'], 'one IN, or --live'),
    (['--live', 'udpm://239.255.76.67:7667?ttl=0', 'out.parquet'], '--live writes .mcap only'),
    (['--seconds', '3', '{run}', 'out.mcap'], 'belong to --live'), (['{run}', 'nowhere/out.mcap'], 'nowhere/out.mcap'),
    (['--live', 'nonsense', 'out.mcap'], 'nonsense')])
def test_bad_input(folder, tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert recorded.main([argument.replace('{run}', str(folder)) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert words in said and len(said.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


LIVE = '''
import subprocess, sys, threading
from abs_hil.interchange import recorded, running
receive = running.received
def received(*arguments):
    # A run of 2 s, which begins when its receiver is there.
    threading.Timer(0.5, subprocess.run, [[sys.argv[1], '--rt', 'off', '--no-out', '--csv', sys.argv[2], '--set',
                                           'experiment.start_speed_rad_s=150']]).start()
    return receive(*arguments)
running.received = received
sys.exit(recorded.main(['--live', '', '--idle', '1', '--seconds', '60', sys.argv[3]]))
'''


def test_live(tmp_path):
    """What a running experiment publishes, recorded and read back: equal to its CSV from the first message received on."""
    probe = subprocess.run(['unshare', '-n', 'true'], capture_output=True, check=False)
    if probe.returncode != 0 or not shutil.which('ip'):
        pytest.skip('no network namespaces here')
    script = pathlib.Path(__file__).parents[2] / 'scripts' / 'in_private_network.sh'
    result = subprocess.run([script, sys.executable, '-c', LIVE, ABS_HIL, tmp_path / 'run.csv', tmp_path / 'run.mcap'],
                            check=False, capture_output=True, text=True, timeout=120,
                            env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    assert result.returncode == 0, result.stderr
    topics = decoded_by_mcap_ros2(tmp_path / 'run.mcap')
    expected = csv_columns(tmp_path / 'run.csv')
    row_at = {time_s: row for row, time_s in enumerate(expected['time_s'].tolist())}
    cycles = [message for _, message in topics['/abs_hil/cycle']]
    assert len(cycles) > 0.5 * len(row_at)
    rows = [row_at[cycle.time_s] for cycle in cycles]
    for name in COLUMNS:
        if name != 'phase':
            assert np.array_equal(bits([getattr(cycle, FIELDS[name]) for cycle in cycles]), bits(expected[name][rows])), name
    assert topics['/abs_hil/status'] and topics['/abs_hil/event'] and topics['/abs_hil/signals']
    lost = int(result.stdout.rsplit('lost: ', 1)[1].split()[0])
    assert lost >= np.sum(np.diff(rows) - 1)


def test_signals_of_a_second_run(tmp_path):
    """Another controller's signals get a definition of their own, and times begin anew where the clock is another."""
    file = open(tmp_path / 'two.mcap', 'wb')
    recorder = running.Recorder(McapFile(file, library='abs_hil'))
    cycles = ((0, 'zeta_N', 1.0, 10**12), (1, 'zeta_N', 2.0, 10**12 + 10**6), (0, 'peak_slip', 3.0, 5))
    for cycle, names, value, stamp_ns in cycles:
        message = abs_hil.telemetry_t()
        message.cycle, message.names, message.values, message.value_count = cycle, names, [value], 1
        message.stamp_ns = stamp_ns
        recorder.take('TELEMETRY', message)
    recorder.finish()
    file.close()
    found = decoded_by_mcap_ros2(tmp_path / 'two.mcap')['/abs_hil/signals']
    of_first = [(time_ns, message.zeta_n) for time_ns, message in found if hasattr(message, 'zeta_n')]
    of_second = [(time_ns, message.peak_slip) for time_ns, message in found if hasattr(message, 'peak_slip')]
    assert [value for _, value in of_first + of_second] == [1.0, 2.0, 3.0]
    assert of_first[1][0] - of_first[0][0] == 10**6
    assert all(abs(time_ns - time.time_ns()) < 60 * 10**9 for time_ns, _ in found)


def test_source_of_an_old_csv_is_refused(folder, tmp_path):
    rows = [row.split(',') for row in (folder / 'run.csv').read_text().splitlines()]
    place = rows[0].index('upper_counts')
    (tmp_path / 'old.csv').write_text('\n'.join(','.join(row[:place]) for row in rows[:50]) + '\n')
    with pytest.raises(ValueError, match='upper_counts'):
        recorded.read(str(tmp_path / 'old.csv'))
    assert recorded.CYCLE_TOPIC == '/abs_hil/cycle' and pathlib.Path(folder).exists()
