"""abs_watch: a running experiment in this terminal, over LCM. `abs_hil watch` starts it (docs/watching.md)."""
import contextlib
import os
import re
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Iterator

from rich.console import Console, Group
from rich.live import Live

from .. import parsers
from ..core import load_network
from ..messages import decode
from ..options import failed
from .screen import Screen, draw, one_line
from .view import RunView

CHANNELS = ('TELEMETRY', 'STATUS', 'EVENT', 'EXPERIMENT')
DRAW_PERIOD_S = 0.2
LINE_PERIOD_S = 1.0
PICTURE = (100, 32)  # columns and rows of --once
ENDING = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 143, signal.SIGQUIT: 131}


class Feed:
    def __init__(self, url: str, prefix: str, window_s: float) -> None:
        self.view = RunView(window_s)
        self._prefix = len(prefix)
        self._subscription = load_network('abs_hil watch').Subscription(url, f'{re.escape(prefix)}({"|".join(CHANNELS)})')
        self.url = self._subscription.url

    def take_until(self, end_s: float) -> None:
        while (left_s := end_s - time.monotonic()) > 0.0:
            if (packet := self._subscription.next(left_s)) is None:
                return
            try:
                message = decode(packet[1])
                if type(message).__name__ != packet[0][self._prefix:].lower() + '_t':
                    raise ValueError('a message of another channel')
            except ValueError:
                self.view.malformed += 1
            else:
                self.view.take(message, time.monotonic())


@contextlib.contextmanager
def keys() -> Iterator[None]:
    """Keys come at once and unseen. What libraries print to the terminal as errors must not disturb the picture."""
    before = termios.tcgetattr(0)
    errors = os.dup(2)
    try:
        tty.setcbreak(0)
        if os.isatty(2):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 2)
            os.close(nowhere)
        yield
    finally:
        with contextlib.suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(0, termios.TCSANOW, before)
        os.dup2(errors, 2)
        os.close(errors)


def on_terminal(feed: Feed, screen: Screen) -> None:
    console = Console(highlight=False, emoji=False, markup=False)
    with keys(), Live(console=console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False) as live:
        while True:
            screen = Screen(*console.size, screen.unicode, screen.source, screen.channel)
            live.update(Group(*draw(feed.view, time.monotonic(), screen)), refresh=True)
            feed.take_until(time.monotonic() + DRAW_PERIOD_S)
            while select.select([0], [], [], 0.0)[0]:
                if os.read(0, 1) in (b'q', b'Q', b''):  # nothing: the terminal was closed
                    return


def in_lines(feed: Feed, screen: Screen) -> None:
    next_s = time.monotonic()
    while True:
        next_s += LINE_PERIOD_S
        while time.monotonic() < next_s:
            feed.take_until(next_s)
        print(one_line(feed.view, time.monotonic(), screen), flush=True)


def one_picture(feed: Feed, screen: Screen, timeout_s: float) -> bool:
    """Complete with a status and a second of telemetry, so that there is a rate to show. False if nothing came."""
    view, end_s, first_s = feed.view, time.monotonic() + timeout_s, None
    while (now_s := time.monotonic()) < end_s:
        first_s = now_s if first_s is None and view.telemetry is not None else first_s
        if view.status is not None and first_s is not None and now_s > first_s + 1.0:
            break
        feed.take_until(min(now_s + DRAW_PERIOD_S, end_s))
    if view.telemetry is None and view.status is None:
        return False
    print('\n'.join(line.plain.rstrip() for line in draw(view, time.monotonic(), screen)))
    return True


def main(arguments: list[str]) -> int:
    p = parsers.watch()
    o = p.parse_args(arguments)
    if not 1.0 <= o.window <= 60.0:
        p.error(f'--window {o.window:g}: must be in [1, 60] s')
    if o.timeout is not None and not o.once:
        p.error('--timeout belongs to --once')
    timeout_s = 5.0 if o.timeout is None else o.timeout
    if not timeout_s > 0.0:
        p.error(f'--timeout {timeout_s:g}: must be above 0 s')
    if not re.fullmatch('[A-Za-z0-9_/-]{0,48}', o.prefix):
        p.error(f"--prefix '{o.prefix}': give at most 48 letters, digits, '_', '-' and '/'")
    locale = os.environ.get('LC_ALL') or os.environ.get('LC_CTYPE') or os.environ.get('LANG') or ''
    unicode = not o.ascii and 'utf' in locale.lower()
    for number, status in ENDING.items():
        signal.signal(number, lambda *_, status=status: sys.exit(status))
    try:
        feed = Feed(o.lcm_url, o.prefix, o.window)
    except (ValueError, OSError) as error:
        return failed('abs_watch', error, 3 if isinstance(error, OSError) else 2)
    screen = Screen(*PICTURE, unicode, feed.url, f'{o.prefix}TELEMETRY')
    if o.once:
        if not one_picture(feed, screen, timeout_s):
            return failed('abs_watch', f'no message arrived within {timeout_s:g} s on {screen.channel}', 3)
    elif o.plain or not (os.isatty(0) and os.isatty(1)) or os.environ.get('TERM', 'dumb') in ('dumb', 'unknown', ''):
        in_lines(feed, screen)
    else:
        on_terminal(feed, screen)
    return 0
