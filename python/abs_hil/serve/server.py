"""The HTTP side: the page and its files, the WebSocket, downloads; and who may have them."""
import asyncio
import contextlib
import hmac
import ipaddress
import logging
import pathlib
import socket
import tempfile
import time
import traceback
from collections.abc import Awaitable, Callable
from typing import Any, BinaryIO
from urllib.parse import urlsplit

import numpy as np
from aiohttp import web

from ..files import parse_json
from ..messages import PHASES, QUANTITIES
from ..places import charts, misfit
from ..run import COLUMNS as CSV_COLUMNS
from ..run import Event, csv_bytes, phase_names
from .feed import Feed
from .runs import BIN_S, COLUMNS, DERIVED, PLACE, RunFacts
from .viewer import REASON_KINDS, STUCK_S, Bad, Viewer, real, whole

_FOLDER = pathlib.Path(__file__).resolve().parent
#: what a browser may fetch: no script, style or connection but this server's own
POLICY = ("default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
          "base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
HEADERS = {'Content-Security-Policy': POLICY, 'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer',
           'Cache-Control': 'no-store', 'Cross-Origin-Resource-Policy': 'same-origin',
           'Cross-Origin-Opener-Policy': 'same-origin', 'X-Frame-Options': 'DENY'}
#: of downloads
DOWNLOADS = {'csv': 'text/csv', 'mcap': 'application/octet-stream'}
KINDS = {'.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css'}
MOST_CONNECTIONS, MOST_VIEWERS, MOST_DOWNLOADS = 128, 64, 4
#: of a download; each is taken within STUCK_S, or the connection is closed
PART_BYTES = 1 << 18
#: a connection that has not become a viewer by then is closed, so that idle ones cannot keep others out
UNDECIDED_S = 10.0
REQUEST_BYTES = 4096
SEND_BUFFER_BYTES = 1 << 17
Command = Callable[[str, str, float], Awaitable[tuple[bool, str]]]


class Door(web.Server):
    """Counts connections. One too many is closed at once; so is one that does not decide what it wants."""

    def __init__(self, handler: Any) -> None:
        super().__init__(handler)
        self._timers: dict[Any, asyncio.TimerHandle] = {}

    def connection_made(self, handler: Any, transport: Any) -> None:
        super().connection_made(handler, transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self.allow(transport, UNDECIDED_S)

    def connection_lost(self, handler: Any, exc: Any = None) -> None:
        super().connection_lost(handler, exc)
        self._timers = {transport: timer for transport, timer in self._timers.items() if not transport.is_closing()}

    def allow(self, transport: Any, seconds: float | None = None) -> None:
        """From now on this connection may stay so long; None: as long as it likes."""
        if transport in self._timers:
            self._timers.pop(transport).cancel()
        if seconds is not None:
            self._timers[transport] = asyncio.get_running_loop().call_later(seconds, transport.abort)


class Server:
    """Serves the feed. host, port: where it listens; token: part of every path, empty where none is needed."""

    def __init__(self, feed: Feed, host: str, port: int, token: str, source: str, command: Command | None) -> None:
        self.feed, self.host, self.port, self.token = feed, host, port, token
        self._command = command
        self._viewers: set[Viewer] = set()
        self._making, self._sending = asyncio.Lock(), asyncio.Semaphore(MOST_DOWNLOADS)  # of downloads
        self._files = {path.name: path.read_bytes() for path in (*(_FOLDER / 'page').iterdir(), *charts().iterdir())
                       if path.suffix in KINDS}
        self._door = Door(self._answer)
        self._runner = web.ServerRunner(self._door, handle_signals=False)
        self._hello = {'kind': 'hello', 'source': source, 'bin_s': BIN_S, 'phases': PHASES, 'reason_kinds': REASON_KINDS,
                       'commands': command is not None,
                       'signals': {name: {'unit': row['unit'], 'meaning': row['meaning'], 'topic': row['topic']}
                                   for name, row in QUANTITIES.items()},
                       'derived': DERIVED}

    @property
    def link(self) -> str:
        host = f'[{self.host}]' if ':' in self.host else self.host
        return f'http://{host}:{self.port}/' + (f'{self.token}/' if self.token else '')

    async def start(self) -> None:
        """Raises OSError if it cannot listen there."""
        for name in ('aiohttp.server', 'asyncio'):
            logging.getLogger(name).addFilter(is_our_fault)
        await self._runner.setup()
        await web.TCPSite(self._runner, self.host, self.port, shutdown_timeout=1.0).start()
        self.port = self._runner.addresses[0][1]

    async def stop(self) -> None:
        await self._runner.cleanup()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        try:
            why = self._refusal(request)
        except ValueError:
            why = 'Host, Origin or the path is malformed'
        if why:
            return refused(403, why)
        path = request.path[len(self.token) + 1:] if self.token else request.path
        if path == '/ws':
            return await self._view(request)
        if path.startswith('/download.'):
            return await self._send_file(request, path.removeprefix('/download.'))
        if (name := path[1:] or 'index.html') not in self._files:
            return refused(404, 'no such page')
        kind = KINDS[pathlib.PurePath(name).suffix]
        return web.Response(body=self._files[name], content_type=kind, charset='utf-8', headers=HEADERS)

    def _refusal(self, request: web.BaseRequest) -> str:
        """Why this request is refused; empty: it is not."""
        if request.method != 'GET':
            return 'only GET is answered'
        if self.token and not hmac.compare_digest(request.path.split('/')[1].encode(), self.token.encode()):
            return 'the token in the link is wrong or missing; use the whole link that abs_hil serve printed'
        host = request.headers.get('Host', '')
        # A foreign name that leads here is an attack by DNS. With a token the name does not matter.
        if not self.token and not is_loopback(urlsplit(f'//{host}').hostname or ''):
            return f'{host[:100]!a} is not the name of this page; use localhost'
        origin = request.headers.get('Origin')
        if origin is not None and urlsplit(origin).netloc != host:
            return f'a page of {origin[:100]!a} may not use this one'
        if request.headers.get('Sec-Fetch-Site', 'none') not in ('none', 'same-origin'):
            return 'another page may not use this one'
        return ''

    async def _view(self, request: web.BaseRequest) -> web.StreamResponse:
        if len(self._viewers) >= MOST_VIEWERS:
            return refused(503, f'{MOST_VIEWERS} viewers watch already')
        answer = web.WebSocketResponse(max_msg_size=REQUEST_BYTES, compress=False, heartbeat=30.0)
        await answer.prepare(request)
        transport: Any = request.transport
        self._door.allow(transport)
        # What waits in the kernel for a slow viewer is old when it arrives.
        transport.get_extra_info('socket').setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        viewer = Viewer(answer, self.feed, self._hello, self._command, transport.abort)
        self._viewers.add(viewer)
        try:
            await viewer.serve()
        finally:
            self._viewers.discard(viewer)
            self._door.allow(transport, STUCK_S)  # what it has not read yet would keep it open
        return answer

    async def _send_file(self, request: web.BaseRequest, kind: str) -> web.StreamResponse:
        """The cycles that the page shows, as a file."""
        if kind not in DOWNLOADS:
            return refused(404, f'give {" or ".join(DOWNLOADS)}')
        if self._making.locked() or self._sending.locked():
            return refused(503, 'other downloads are under way')
        try:
            asked = {name: parse_json(value) for name, value in request.query.items()}
            if (run := self.feed.runs.get(whole(asked, 'run'))) is None:
                raise Bad('this run is no longer kept')
            rows = self.feed.history.rows_of(run.number, real(asked, 'from_s'), real(asked, 'to_s'), 1 << 30)
            if len(rows) == 0:
                raise Bad('no cycle of this time is kept: the server has the newest ones only')
        except ValueError as error:
            return refused(400, str(error))
        transport = request.transport
        self._door.allow(transport)
        async with self._making:
            try:
                file = await asyncio.get_running_loop().run_in_executor(None, file_of, kind, run, rows)
            except (ImportError, OSError) as error:  # no package, or no room
                return refused(501, misfit(error) or str(error))
        del rows  # some MB, which a slow download would keep
        name = f'abs_hil-run-{run.number}-{time.strftime("%Y%m%d-%H%M%S", time.localtime(run.began))}.{kind}'
        answer = web.StreamResponse(headers={**HEADERS, 'Content-Disposition': f'attachment; filename="{name}"',
                                             'Content-Type': DOWNLOADS[kind], 'Content-Length': str(file.seek(0, 2))})
        answer.force_close()
        file.seek(0)
        async with self._sending:
            with file, contextlib.suppress(ConnectionError):
                await answer.prepare(request)
                while part := file.read(PART_BYTES):
                    self._door.allow(transport, STUCK_S)
                    await answer.write(part)
        return answer


def refused(status: int, why: str) -> web.Response:
    answer = web.Response(status=status, text=f'abs_hil serve: {why}\n', headers=HEADERS)
    answer.force_close()
    return answer


def is_our_fault(record: logging.LogRecord) -> bool:
    """Whether a logged exception came through this package: clients cause the others at will, and would fill the disk."""
    error = record.exc_info[1] if record.exc_info else None
    return error is not None and not isinstance(error, ConnectionError) and any(
        frame.f_globals.get('__package__') == __package__ for frame, _ in traceback.walk_tb(error.__traceback__))


def file_of(kind: str, run: RunFacts, rows: np.ndarray) -> BinaryIO:
    """An open file without a name: CSV has the columns of --csv, bit-exactly, and the controller's own signals. Raises
    ImportError without the package mcap, OSError on a full disk."""
    columns = {name: rows[:, PLACE[name]] for name in CSV_COLUMNS} | dict(zip(run.own, rows[:, len(COLUMNS):].T))
    phase = columns['phase']
    columns['phase'] = phase_names(np.where((phase >= 0) & (phase < len(PHASES)), phase, PHASES.index('fault')))
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder, f'run-{run.number}.csv')
        place.write_bytes(csv_bytes(columns))
        if kind == 'mcap':
            from ..interchange import recorded
            read = recorded.read(str(place))
            read.events = [Event(event['time_s'], event['kind'], '', message=event['text']) for event in run.events]
            place = place.with_suffix('.mcap')
            recorded.to_mcap(read, str(place))
        return place.open('rb')


def is_loopback(host: str) -> bool:
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == 'localhost'
