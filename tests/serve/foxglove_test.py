"""The stream for Foxglove and others, read by decoders that are not its server's: frames by the library websockets and the
lines below, schemas and messages by mcap_ros2.

usage: foxglove_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT
"""
import asyncio
import contextlib
import json
import math
import os
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile

import lcm
import websockets
from live import check, drive_for, enter_private_network
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from scope import Served, Viewer, cycles_of

import abs_hil
from abs_hil.interchange.messages import field_names

MESSAGE = 1  # opcode of a message
STUCK, STUCK_S, GARBAGE_FRAMES = 5, 14, 10_000
#: a full backlog of each stuck viewer: 8192 messages of about 600 bytes, and what holds them
MOST_GROWN_KB = STUCK * 8192


class Client:
    """Subscribes to what it is told of, and keeps what comes, unless `whole` is False."""

    def __init__(self, link, whole=True):
        self.link, self.whole = link, whole
        self.topics, self.kept, self.statuses = {}, {}, []  # kept: channel -> [(time in ns, bytes)]
        self.count = self.newest_ns = 0  # of cycles

    async def __aenter__(self):
        self._connection = await websockets.connect(self.link, subprotocols=['foxglove.sdk.v1'], max_size=None)
        self._task = asyncio.create_task(self._receive())
        return self

    async def __aexit__(self, *_):
        self._task.cancel()
        self._connection.transport.abort()  # a farewell would wait for what the server still sends

    async def _receive(self):
        async for data in self._connection:
            if isinstance(data, bytes):
                self._take(data)
                continue
            told = json.loads(data)
            if told['op'] == 'advertise':
                asked = []
                for channel in told['channels']:
                    self.topics[channel['id']] = channel
                    asked.append({'id': channel['id'], 'channelId': channel['id']})
                await self._connection.send(json.dumps({'op': 'subscribe', 'subscriptions': asked}))
            elif told['op'] == 'status':
                self.statuses.append(told)

    def _take(self, data):
        opcode, subscription, time_ns = struct.unpack_from('<BIQ', data)
        assert opcode == MESSAGE, opcode
        channel = self.topics[subscription]
        if channel['topic'] == '/abs_hil/cycle':
            self.count, self.newest_ns = self.count + 1, time_ns
        if self.whole:
            self.kept.setdefault(subscription, []).append((time_ns, data[13:]))

    def messages(self):
        """topic -> [(time in ns, message)], decoded by the schema that the server told."""
        found = {}
        for number, kept in self.kept.items():
            channel = self.topics[number]
            schema = Schema(number, channel['schema'].encode(), channel['schemaEncoding'], channel['schemaName'])
            decode = DecoderFactory().decoder_for(channel['encoding'], schema)
            found.setdefault(channel['topic'], []).extend((time_ns, decode(data)) for time_ns, data in kept)
        return found

    async def send(self, frame):
        await self._connection.send(frame)


def second_link(server):
    line = server.process.stdout.readline()
    check('ws://127.0.0.1:' in line, 'the address is said', line)
    return line.split()[-1]


def same(a, b):
    return a == b or (math.isnan(a) and math.isnan(b))


async def each_cycle(server, program, folder):
    """What arrives has the values of the run's own log."""
    log = folder / 'run.lcmlog'
    async with Client(second_link(server)) as client, Viewer(server.socket, ['slip']) as viewer:
        run = await asyncio.create_subprocess_exec(program, '--log', log, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        check(await run.wait() == 0, 'the run completes')
        await asyncio.sleep(1)
        got = client.messages()
        lost = viewer.facts[max(viewer.facts)]['lost']  # by the network of a busy computer
        phases = {name: float(number) for number, name in enumerate(abs_hil.PHASES)}
        cycles = cycles_of(log)
        names = field_names(name for name, row in abs_hil.QUANTITIES.items() if row['csv_column'] is not None)
        arrived = {message.time_s: (time_ns, message) for time_ns, message in got['/abs_hil/cycle']}
        check(len(arrived) + lost == len(cycles), f'{len(arrived)} of {len(cycles)} cycles arrive', lost)
        for cycle in cycles:
            if cycle['time_s'] not in arrived:
                continue
            time_ns, message = arrived[cycle['time_s']]
            wrong = [name for name, field in names.items()
                     if not same(getattr(message, field), float(phases.get(cycle[name], cycle[name])))]
            assert not wrong, (cycle['cycle'], wrong)
        times = [time_ns for time_ns, _ in got['/abs_hil/cycle']]
        lasted_s = (times[-1] - times[0]) / 1e9
        check(abs(lasted_s - cycles[-1]['time_s']) < 0.1 and abs(times[-1] / 1e9 - log.stat().st_mtime) < 3,
              'times are Unix times', lasted_s, cycles[-1]['time_s'])
        known = [cycle['zeta_N'] for cycle in cycles if cycle['time_s'] in arrived and not math.isnan(cycle['zeta_N'])]
        check(known == [message.zeta_n for _, message in got['/abs_hil/signals']], "the controller's own signals", len(known))
        events = [abs_hil.event_t.decode(event.data) for event in lcm.EventLog(str(log)) if event.channel == 'ABS_EVENT']
        check([message.msg for _, message in got['/abs_hil/event']] == [event.message or event.reason_text for event in events],
              'events in words', got['/abs_hil/event'])
        check(len(got['/abs_hil/status']) >= 4, 'health each second', len(got['/abs_hil/status']))
        units = next(channel['schema'] for channel in client.topics.values() if channel['topic'] == '/abs_hil/cycle')
        check('rad/s' in units and abs_hil.QUANTITIES['slip_est']['meaning'] in units, 'units and meanings', units)


async def stuck_and_hostile(server, program, folder):
    """Viewers that read nothing cost bounded memory, and a good one gets each cycle; nobody can send anything."""
    link = second_link(server)
    address = int(link.rsplit(':', 1)[1])
    sockets = [line.split()[1] for line in pathlib.Path('/proc/net/tcp').read_text().splitlines()[1:]]
    check(f'0100007F:{address:04X}' in sockets and f'00000000:{address:04X}' not in sockets, 'it listens at 127.0.0.1 only',
          sockets)
    # The kernel would hold all of this run for a stuck viewer.
    pathlib.Path('/proc/sys/net/ipv4/tcp_wmem').write_text('4096 16384 65536')
    stuck = [await reads_nothing(address) for _ in range(STUCK)]
    async with Client(link, whole=False) as good, Client(link, whole=False) as bad, Viewer(server.socket, ['slip']) as viewer:
        await asyncio.sleep(0.5)
        before_kB = server.memory_kB()
        run = await asyncio.create_subprocess_exec(program, *drive_for(folder, STUCK_S), '--summary', folder / 's.json',
                                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        await bad.send(json.dumps({'op': 'advertise', 'channels': [{'id': 1, 'topic': '/abs_hil/command', 'encoding': 'json',
                                                                    'schemaName': ''}]}))
        with contextlib.suppress(websockets.ConnectionClosed, asyncio.TimeoutError):
            async with asyncio.timeout(STUCK_S / 2):  # the server hears who talks too much no more
                for number in range(GARBAGE_FRAMES):
                    await bad.send((b'\xff' * 50, '{"op":', '[[[[', '{"op":"subscribe","subscriptions":7}')[number % 4])
        check(await run.wait() == 0, 'the run completes')
        await asyncio.sleep(1)
        check(any(status['level'] >= 1 for status in bad.statuses), 'nobody may publish', bad.statuses[:3])
        grown_kB = server.memory_kB() - before_kB
        check(grown_kB < MOST_GROWN_KB, f'{STUCK} stuck viewers cost {grown_kB} kB')
        summary = json.loads((folder / 's.json').read_text())
        check(summary['telemetry_drops'] == summary['publish_failures'] == 0, 'the run dropped nothing')
        lost = viewer.facts[max(viewer.facts)]['lost']
        check(good.count + lost == summary['cycles'], f'the good viewer got {good.count} of {summary["cycles"]} cycles')
        newest = await read_again(stuck[0])
        check(newest['count'] < summary['cycles'] - 1000 and newest['time_ns'] == good.newest_ns,
              f'after {STUCK_S} s one of them gets the newest {newest["count"]} messages', newest, good.newest_ns)
    for connection in stuck:
        connection.transport.abort()


async def reads_nothing(port):
    """A viewer of the cycles that stops reading; the kernel's buffers are small."""
    small = socket.socket()
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    small.connect(('127.0.0.1', port))
    connection = await websockets.connect(f'ws://127.0.0.1:{port}', sock=small, subprotocols=['foxglove.sdk.v1'], max_queue=1,
                                          read_limit=1024, ping_interval=None)
    channels = []
    while '/abs_hil/cycle' not in (channel['topic'] for channel in channels):
        channels = json.loads(await connection.recv()).get('channels', [])
    cycle = next(channel['id'] for channel in channels if channel['topic'] == '/abs_hil/cycle')
    await connection.send(json.dumps({'op': 'subscribe', 'subscriptions': [{'id': 1, 'channelId': cycle}]}))
    connection.transport.pause_reading()
    return connection


async def read_again(connection):
    """Number of the messages that wait for it, and the newest one's time."""
    connection.transport.resume_reading()
    found = {'count': 0, 'time_ns': 0}
    with contextlib.suppress(asyncio.TimeoutError):
        while True:
            data = await asyncio.wait_for(connection.recv(), 2)
            if isinstance(data, bytes):
                found = {'count': found['count'] + 1, 'time_ns': struct.unpack_from('<BIQ', data)[2]}
    return found


def refused(serve, folder):
    (folder / 'foxglove.py').write_text('raise ImportError("No module named \'foxglove\'")\n')
    without = {**os.environ, 'PYTHONPATH': f'{folder}:{os.environ["PYTHONPATH"]}'}
    for options, environment, status, words in (
            (['--foxglove'], without, 3, 'python-packages-tests.txt'),
            (['--foxglove', '65536'], None, 2, 'LOG stands before --foxglove'),
            ([folder / 'run.lcmlog', '--speed', '0', '--foxglove', '0'], None, 2, 'give --speed above 0')):
        ended = subprocess.run([serve, '--port', '0', *options], env=environment, capture_output=True, text=True, timeout=30)
        check(ended.returncode == status and words in ended.stderr, words, ended)
    server = Served(serve, '--foxglove', '0')
    port = second_link(server).rsplit(':', 1)[1]
    ended = subprocess.run([serve, '--port', '0', '--foxglove', port], capture_output=True, text=True, timeout=30)
    check(ended.returncode == 3 and 'give another port' in ended.stderr, 'a port that is taken', ended)
    check(server.end() == (143, ''), 'no complaint')


def main():
    program, serve, private_network = sys.argv[1:4]
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for trial in (each_cycle, stuck_and_hostile):
            server = Served(serve, '--foxglove', '0')
            try:
                asyncio.run(trial(server, program, folder))
            finally:
                ended = server.end()
            check(ended[0] == 143, 'the server ends by SIGTERM', ended)
        refused(serve, folder)


if __name__ == '__main__':
    main()
