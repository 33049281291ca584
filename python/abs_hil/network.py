"""Messages of a running rig, over LCM."""
import contextlib
import re
from collections.abc import Iterator
from typing import Any

from .core import load_network
from .messages import decode


def live(url: str = '', *, channel: str = 'TELEMETRY', prefix: str = 'ABS_', timeout_s: float | None = None) -> Iterator[Any]:
    """Yields the messages of a running experiment as they come: by default one telemetry_t a cycle.

    url:       the LCM network; empty: LCM_DEFAULT_URL, else UDP multicast within this computer.
    channel:   TELEMETRY, STATUS, EVENT, EXPERIMENT, ...; the run's telemetry.channel_prefix stands before it.
    timeout_s: ends the iteration after this time without a message; None waits for ever.

    Subscribes at once. Messages that are damaged or of another type are left out. Raises OSError without a network and
    ValueError for a URL that is none.
    """
    subscription = load_network('abs_hil.live').Subscription(url, re.escape(prefix + channel))
    return _messages(subscription, timeout_s)


def _messages(subscription: Any, timeout_s: float | None) -> Iterator[Any]:
    while True:
        received = subscription.next(1.0 if timeout_s is None else timeout_s)
        if received is not None:
            with contextlib.suppress(ValueError):
                yield decode(received[1])
        elif timeout_s is not None:
            return
