"""One viewer: a WebSocket with two cursors, one into the bins and one into the facts of the runs. It holds no queue of
data, so a slow viewer costs no memory: what it falls behind too far is left out, counted and told."""
import asyncio
import json
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from aiohttp import WSCloseCode, WSMsgType, web

from ..files import parse_json
from ..messages import PHASES, REASONS
from .feed import Feed
from .runs import PLACE, RunFacts, own_place

TICK_S = 0.05
FACTS_S = 0.25
#: values of one frame; bins (5 s) that a viewer may be late once it has caught up
MOST_VALUES, LATE_BINS = 8000, 250
MOST_SIGNALS, MOST_ROWS, MOST_REPLIES = 40, 20_000, 8
#: requests that a viewer may make at once, and a second
BURST, RATE_PER_S = 60.0, 20.0
MOST_BAD = 20
STUCK_S = 20.0
BINS, ROWS = 1, 2
REASON_KINDS = tuple(dict.fromkeys(row['kind'] for number, row in REASONS.items() if number))


class Bad(ValueError):
    """A request that is none; the text says what is wrong."""


class Trigger:
    """Looks at each cycle until one meets the condition."""

    def __init__(self, asked: dict[str, Any]) -> None:
        self._before, self._run = math.nan, -1  # the last value, and the run that it is of
        self._words: Callable[[np.ndarray], str] = lambda row: ''
        #: of the signal's values one row earlier, its values, and the rows
        self._hits: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
        kind = asked.get('on')
        if kind == 'level':
            self._signal, level, edge = text(asked, 'signal'), real(asked, 'level'), text(asked, 'edge')
            if edge not in ('rise', 'fall', 'either'):
                raise Bad(f'edge "{edge}": give rise, fall or either')
            self._hits = lambda before, values, rows: (
                (edge != 'fall') & (before < level) & (values >= level) | (edge != 'rise') & (before > level) & (values <= level))
        elif kind == 'phase':
            name = _one_of(asked, 'phase', PHASES)
            self._signal = 'phase_index'
            self._words = lambda row: dict(enumerate(PHASES)).get(int(row[PLACE['phase']]), '')
            self._hits = lambda before, values, rows: (values != before) & ~np.isnan(before) & (
                not name or rows[:, PLACE['phase']] == PHASES.index(name))
        elif kind == 'event':
            name = _one_of(asked, 'event', REASON_KINDS)
            reasons = [number for number, row in REASONS.items() if number and name in ('', row['kind'])]
            self._signal = 'reason'
            self._words = lambda row: str(REASONS[int(row[PLACE['reason']])]['text'])
            self._hits = lambda before, values, rows: np.isin(values, reasons)
        else:
            raise Bad(f'on "{kind}": give level, phase or event')

    def look(self, run: RunFacts, rows: np.ndarray) -> dict[str, Any] | None:
        """What a viewer is told of the first cycle that meets it; None: none of these does."""
        if (place := own_place(run.own, self._signal)) is None:
            return None
        values = rows[:, place]
        before = np.concatenate(([self._before if run.number == self._run else math.nan], values[:-1]))
        self._run, self._before = run.number, float(values[-1])
        for place in np.flatnonzero(self._hits(before, values, rows))[:1].tolist():
            row = rows[place]
            return {'kind': 'caught', 'run': run.number, 'time_s': float(row[PLACE['time_s']]), 'cycle': int(row[PLACE['cycle']]),
                    'value': float(values[place]), 'text': self._words(row)}
        return None


class Viewer:
    """Sends to one WebSocket until it closes.

    command: sends a command, None where the page may only watch; (accepted, answer in words).
    abort: ends the connection at once.
    """

    def __init__(self, socket: web.WebSocketResponse, feed: Feed, hello: dict[str, Any], command: Any,
                 abort: Callable[[], None]) -> None:
        self._socket, self._feed, self._hello, self._command, self._abort = socket, feed, hello, command, abort
        self._replies: deque[str | bytes] = deque()
        self._signals: list[str] = []
        self._version = 0
        self._cursor = feed.history.bins.tail
        self._caught_up = False
        self._told: dict[int, int] = {}
        self._trigger: Trigger | None = None
        self._tokens, self._refilled = BURST, time.monotonic()
        self._bad = 0
        self._tasks: set[asyncio.Task[None]] = set()
        self.dropped = 0  # bins

    async def serve(self) -> None:
        self._feed.listeners.append(self._look)
        sender = asyncio.create_task(self._send())
        try:
            async for message in self._socket:
                if message.type is not WSMsgType.TEXT:
                    self._note_bad('a request is text')
                else:
                    self._take(message.data)
                if self._bad > MOST_BAD:
                    await self._socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b'too many bad requests')
                    return
        finally:
            self._feed.listeners.remove(self._look)
            sender.cancel()

    def _look(self, run: RunFacts, rows: np.ndarray) -> None:
        if self._trigger is not None and (caught := self._trigger.look(run, rows)) is not None:
            self._trigger = None
            self._reply(caught)

    # ---- requests
    def _take(self, data: str) -> None:
        now = time.monotonic()
        self._tokens = min(BURST, self._tokens + (now - self._refilled) * RATE_PER_S)
        self._refilled = now
        if self._tokens < 1.0:
            self._note_bad(f'more than {RATE_PER_S:g} requests a second')
            return
        self._tokens -= 1.0
        try:
            asked = parse_json(data)
            if not isinstance(asked, dict):
                raise Bad('a request is a JSON object')
            handler = {'show': self._show, 'trigger': self._arm, 'rows': self._rows,
                       'command': self._send_command}.get(asked.get('do', ''))
            if handler is None:
                raise Bad('do: give show, trigger, rows or command')
            handler(asked)
        except (ValueError, TypeError) as error:
            self._note_bad(str(error))

    def _note_bad(self, why: str) -> None:
        self._bad += 1
        if self._bad <= MOST_BAD:
            self._reply({'kind': 'refused', 'text': why[:200]})

    def _reply(self, answer: dict[str, Any] | bytes) -> None:
        if len(self._replies) < MOST_REPLIES:
            self._replies.append(answer if isinstance(answer, bytes) else as_json(answer))

    def _show(self, asked: dict[str, Any]) -> None:
        self._signals, self._version = signals(asked), whole(asked, 'version')
        self._cursor, self._caught_up = self._feed.history.bins.tail, False

    def _arm(self, asked: dict[str, Any]) -> None:
        self._trigger = None if asked.get('on') == 'off' else Trigger(asked)

    def _rows(self, asked: dict[str, Any]) -> None:
        if (run := self._feed.runs.get(whole(asked, 'run'))) is None:
            raise Bad('this run is no longer kept')
        names = ['time_s', 'cycle', *signals(asked)]
        rows = self._feed.history.rows_of(run.number, real(asked, 'from_s'), real(asked, 'to_s'), MOST_ROWS)
        head = np.array([ROWS, whole(asked, 'version'), run.number, len(rows), len(names), 0, 0, 0], dtype='<i4')
        self._reply(head.tobytes() + columns_of(run, rows, names).astype('<f8').tobytes())

    def _send_command(self, asked: dict[str, Any]) -> None:
        if self._command is None:
            raise Bad('this page may only watch: abs_hil serve was started without --commands KEYFILE')
        if self._tasks and asked.get('command') != 'stop':
            raise Bad('the command before has no answer yet')
        if len(self._tasks) > 2:
            return  # stops under way: each repeats itself until it is answered
        order = (text(asked, 'command'), text({'name': asked.get('name') or ''}, 'name'),
                 real({'value': asked.get('value') or 0.0}, 'value'))

        async def run() -> None:
            accepted, answer = await self._command(*order)
            self._reply({'kind': 'answer', 'command': order[0], 'accepted': accepted, 'text': answer})
        task = asyncio.create_task(run())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # ---- what goes out
    async def _send(self) -> None:
        try:
            await self._put(as_json(self._hello))
            next_facts = 0.0
            while not self._socket.closed:
                now = time.monotonic()
                if now >= next_facts:
                    next_facts = now + FACTS_S
                    for run in list(self._feed.runs.values()):
                        if self._told.get(run.number) != run.version:
                            self._told[run.number] = run.version
                            await self._put(as_json(run.told()))
                    self._told = {number: version for number, version in self._told.items() if number in self._feed.runs}
                while self._replies:
                    await self._put(self._replies.popleft())
                if not await self._send_bins():
                    await asyncio.sleep(TICK_S)
        except (TimeoutError, ConnectionError):
            self._abort()  # it does not read: a farewell would not arrive

    async def _put(self, data: str | bytes) -> None:
        await asyncio.wait_for(self._socket.send_str(data) if isinstance(data, str) else self._socket.send_bytes(data), STUCK_S)

    async def _send_bins(self) -> bool:
        """Sends one frame. True: there is more to send at once."""
        bins = self._feed.history.bins
        if not self._signals:
            return False
        behind = bins.tail - self._cursor
        if self._caught_up and bins.head - self._cursor > LATE_BINS:
            behind = bins.head - 1 - self._cursor
        if behind > 0:
            self.dropped += behind
            self._cursor += behind
        if self._cursor == bins.head:
            self._caught_up = True
            return False
        places = bins.places(self._cursor, self._cursor + MOST_VALUES // len(self._signals))
        number = bins.run[places[0]]
        places = places[:int(np.argmin(bins.run[places] == number)) or len(places)]  # of one run
        run = self._feed.runs.get(int(number))
        self._cursor += len(places)
        if run is not None:
            await self._put(self._frame(run, places))
        return self._cursor < bins.head

    def _frame(self, run: RunFacts, places: np.ndarray) -> bytes:
        history = self._feed.history
        count = len(places)
        head = np.array([BINS, self._version, run.number, count, len(self._signals), self.dropped, 0, 0], dtype='<i4')
        numbers = np.zeros(count + count % 2, dtype='<i4')  # the values behind them begin at a multiple of 8 bytes
        numbers[:count] = history.numbers[places]
        values = history.bins.values[places]
        low, high = (columns_of(run, values[:, side], self._signals).astype('<f8') for side in (0, 1))
        return b''.join(part.tobytes() for part in (head, numbers, low, high))


def columns_of(run: RunFacts, rows: np.ndarray, names: list[str]) -> np.ndarray:
    """The signals of rows of WIDTH values, of shape (signals, rows); NaN for one that the run lacks."""
    places = [own_place(run.own, name) for name in names]
    return np.array([np.full(len(rows), np.nan) if place is None else rows[:, place] for place in places])


def as_json(answer: dict[str, Any]) -> str:
    return json.dumps(answer, allow_nan=False, separators=(',', ':'), default=list)


def _given(asked: dict[str, Any], name: str, kind: Any, valid: Callable[[Any], bool], what: str) -> Any:
    value = asked.get(name)
    if isinstance(value, bool) or not isinstance(value, kind) or not valid(value):
        raise Bad(f'{name}: give {what}')
    return value


def text(asked: dict[str, Any], name: str) -> str:
    return _given(asked, name, str, lambda value: len(value) <= 200 and value.isprintable(), 'a text that can be printed')


def _one_of(asked: dict[str, Any], name: str, known: tuple[str, ...]) -> str:
    value = text(asked, name)
    if value and value not in known:
        raise Bad(f'{name} "{value}": give one of {", ".join(known)}, or "" for any')
    return value


def real(asked: dict[str, Any], name: str) -> float:
    return float(_given(asked, name, (int, float), lambda value: abs(value) <= 1e308, 'a number up to 1e308'))


def whole(asked: dict[str, Any], name: str) -> int:
    return _given(asked, name, int, lambda value: 0 <= value < 1 << 31, 'a whole number')


def signals(asked: dict[str, Any]) -> list[str]:
    return _given(asked, 'signals', list, lambda names: len(names) <= MOST_SIGNALS and all(isinstance(one, str) for one in names),
                  f'at most {MOST_SIGNALS} names')
