"""Shared by the tests of `abs_hil serve`: the server as a process, and a viewer by the library websockets."""
import asyncio
import http.client
import json
import os
import pathlib
import subprocess
from urllib.parse import urlsplit

import numpy as np
import websockets

BIN_S = 0.02
BINS, ROWS = 1, 2


class Served:
    """A running abs_hil serve."""

    def __init__(self, program, *options):
        self.process = subprocess.Popen([program, '--port', '0', *map(str, options)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        assert line.startswith('abs_hil serve: http://'), (line, self.process.stderr.read())
        self.link = line.split()[-1]

    @property
    def socket(self):
        return self.link.replace('http:', 'ws:') + 'ws'

    def cpu_s(self):
        fields = pathlib.Path(f'/proc/{self.process.pid}/stat').read_text().rsplit(')', 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def memory_kB(self):
        status = pathlib.Path(f'/proc/{self.process.pid}/status').read_text()
        return int(status.split('VmRSS:')[1].split()[0])

    def end(self):
        self.process.terminate()
        _, errors = self.process.communicate(timeout=20)
        return self.process.returncode, errors


class Viewer:
    """Collects what the server sends: the bins of each run, the facts of runs, rows, replies."""

    def __init__(self, socket, signals):
        self.socket, self.signals = socket, signals
        self.bins, self.facts, self.rows, self.replies, self.dropped = {}, {}, [], [], 0

    async def __aenter__(self):
        self._connection = await websockets.connect(self.socket, max_size=None)
        self.hello = json.loads(await self._connection.recv())
        await self.ask(do='show', signals=self.signals, version=1)
        self._task = asyncio.create_task(self._receive())
        return self

    async def __aexit__(self, *_):
        self._task.cancel()
        await self._connection.close()

    async def ask(self, **request):
        await self._connection.send(json.dumps(request))

    async def _receive(self):
        async for message in self._connection:
            if isinstance(message, str):
                told = json.loads(message)
                if told['kind'] == 'run':
                    self.facts[told['run']] = told
                else:
                    self.replies.append(told)
                continue
            kind, version, run, count, width, dropped = np.frombuffer(message, '<i4', 6)
            if kind == ROWS:
                self.rows.append(np.frombuffer(message, '<f8', offset=32).reshape(width, count))
                continue
            assert (kind, version, width) == (BINS, 1, len(self.signals)), (kind, version, width)
            numbers = np.frombuffer(message, '<i4', count, offset=32)
            values = np.frombuffer(message, '<f8', offset=32 + 4 * (count + count % 2)).reshape(2, width, count)
            self.dropped = int(dropped)
            for place, number in enumerate(numbers.tolist()):
                self.bins.setdefault(int(run), {}).setdefault(number, []).append(values[:, :, place])

    async def until(self, holds, what, seconds=30):
        for _ in range(int(seconds / 0.05)):
            if holds():
                return
            await asyncio.sleep(0.05)
        raise AssertionError(what)

    def envelope(self, run):
        """number of the bin -> (least, greatest) of each signal."""
        return {number: (np.fmin.reduce([v[0] for v in parts]), np.fmax.reduce([v[1] for v in parts]))
                for number, parts in self.bins[run].items()}


def cycles_of(log):
    """The telemetry of an event log, by LCM's own module."""
    import lcm

    import abs_hil
    return [abs_hil.row_of(abs_hil.telemetry_t.decode(event.data)) for event in lcm.EventLog(str(log))
            if event.channel == 'ABS_TELEMETRY']


def outside(envelope, cycles, signals):
    """Values that lie outside the envelope, and bounds that no cycle has: (bin, signal, value, bound)."""
    wrong, reached = [], {}
    nothing = np.full((2, len(signals)), np.nan)
    for cycle in cycles:
        number = int(np.floor(cycle['time_s'] / BIN_S + 1e-6))
        low, high = envelope.get(number, nothing)
        for place, signal in enumerate(signals):
            value = float(cycle.get(signal, np.nan))
            if value == value and not low[place] <= value <= high[place]:
                wrong.append((number, signal, value, low[place], high[place]))
            met = reached.setdefault((number, place), [value, value])
            met[:] = np.fmin(met[0], value), np.fmax(met[1], value)
    for (number, place), met in reached.items():
        bounds = [side[place] for side in envelope.get(number, nothing)]
        if not np.array_equal(met, bounds, equal_nan=True):
            wrong.append((number, signals[place], met, bounds))
    return wrong


def answer(server, path, **headers):
    connection = http.client.HTTPConnection(urlsplit(server.link).netloc, timeout=10)
    connection.request('GET', path, headers={name.replace('_', '-'): value for name, value in headers.items()})
    got = connection.getresponse()
    return got.status, got.read().decode(errors='replace'), got.headers


async def stuck(server):
    """Asks for all signals and never reads."""
    host = urlsplit(server.link)
    reader, writer = await asyncio.open_connection(host.hostname, host.port, limit=1)
    reader._transport.pause_reading()
    writer.write(f'GET /ws HTTP/1.1\r\nHost: {host.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
                 'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n'.encode())
    return writer
