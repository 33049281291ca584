"""The command line of abs_serve; `abs_hil serve` starts it."""
import argparse
import asyncio
import contextlib
import re
import secrets
import signal
from functools import partial
from typing import Any

from .. import parsers
from ..core import load_network
from ..files import refusal
from ..options import as_main
from .feed import Feed, Played
from .runs import BIN_S, History
from .server import Server, is_loopback

COMMANDS = ('stop', 'start', 'continue', 'slip-ref', 'gain')
ANSWER_S = 3.0


@as_main(parsers.serve, os_error=3)
def main(given: argparse.Namespace) -> int:
    source = _source(given)
    if given.commands is not None:
        load_network('--commands').check_key(given.commands)
    return 128 + asyncio.run(_serve(given, source))


def _source(given: argparse.Namespace) -> Any:
    """What has the packets that are `waiting()`: a network's Subscription, or Played. Raises OSError without a network."""
    if not 0 <= given.port < 65536:
        raise ValueError(f'--port {given.port}: give a number in [0, 65535]')
    if given.log is None:
        if given.speed != 1.0:
            raise ValueError('--speed belongs to LOG')
        return load_network('abs_hil serve').Subscription(given.lcm_url, re.escape(given.prefix) + '.*')
    if given.commands is not None:
        raise ValueError('--commands belongs to a running experiment, not to LOG')
    if not 0 <= given.speed <= 1000:
        raise ValueError(f'--speed {given.speed:g}: give a number in [0, 1000]')
    if given.foxglove is not None and given.speed == 0:
        raise ValueError('--foxglove shows what comes while it is looked at: give --speed above 0')
    if given.prefix == parsers.serve().get_default('prefix'):
        given.prefix = ''  # a recording is shown whole, unless a prefix is given
    return Played(given.log, given.speed, given.prefix)


async def _send(given: Any, command: str, name: str, value: float) -> tuple[bool, str]:
    if command not in COMMANDS:
        return False, f'"{command}" is no command: give one of {" ".join(COMMANDS)}'
    try:
        return await asyncio.get_running_loop().run_in_executor(
            None, load_network('a command').send_command, command, name, value, given.lcm_url, given.prefix, given.commands,
            ANSWER_S)
    except (OSError, ValueError) as error:
        return False, str(error)


async def _serve(given: Any, source: Any) -> int:
    """Serves until a signal comes; its number."""
    feed = Feed(History(), given.prefix)
    # Another user of this computer could connect to its own address too, so commands always need the token.
    token = secrets.token_urlsafe(24) if given.commands is not None or not is_loopback(given.host) else ''
    shown = given.log or given.lcm_url or 'LCM'
    server = Server(feed, given.host, given.port, token, shown, partial(_send, given) if given.commands is not None else None)
    foxglove = None
    if given.foxglove is not None:
        from ..interchange.running import Foxglove
        foxglove = Foxglove(given.foxglove)
        feed.message_listeners.append(foxglove.translate)
    try:
        await server.start()
    except OSError as error:
        why = refusal(error, given.host, 'reach')
        raise OSError(f'cannot listen at --host {given.host}, --port {given.port}: {why}') from None
    print(f'abs_hil serve: {server.link}', flush=True)
    if foxglove is not None:
        print(f'abs_hil serve: for Foxglove, Lichtblick, PlotJuggler: {foxglove.link}', flush=True)
    signals = asyncio.Queue[int]()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, signals.put_nowait, int(number))
    try:
        while True:
            feed.take(source.waiting())
            with contextlib.suppress(TimeoutError):
                return await asyncio.wait_for(signals.get(), BIN_S)
    finally:
        await server.stop()
        if foxglove is not None:
            foxglove.server.stop()
