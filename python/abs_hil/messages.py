"""The messages of abs_hil, which a running experiment publishes over LCM and writes to its event logs (.lcmlog).

    import abs_hil
    message = abs_hil.decode(data)                  # any of the types
    message = abs_hil.telemetry_t.decode(data)      # this one, else ValueError

lcmtypes/*.lcm lists every field with its unit and range.
"""
import contextlib
import importlib
import json
import pkgutil
import re
from collections.abc import Iterator
from typing import Any

from .places import folders, place_of

#: name -> class of every message type
TYPES: dict[str, Any] = {one.name: getattr(importlib.import_module(f'.{one.name}', __package__), one.name)
                         for one in pkgutil.iter_modules(folders()) if one.name.endswith('_t')}


def _table(name: str, key: str) -> dict[Any, dict[str, Any]]:
    return {row[key]: row for row in json.loads(place_of(name).read_text(encoding='utf-8'))}


#: name -> unit, type, meaning and so on of every quantity of a cycle, in the order of the CSV columns
QUANTITIES = _table('quantities.json', 'name')
#: number -> name, kind and text of every reason (field `reason`)
REASONS = _table('reasons.json', 'number')
#: names of the values of the field `phase`, as in the CSV
PHASES: tuple[str, ...] = tuple(QUANTITIES['phase']['values'])
#: a controller has at most this many signals of its own
MOST_SIGNALS = 8

_BY_FINGERPRINT = {type_._get_packed_fingerprint(): type_ for type_ in TYPES.values()}


def row_of(message: Any) -> dict[str, Any]:
    """The cycle in a telemetry_t: every quantity of the table and every signal of the controller, by name."""
    row = {name: getattr(message, name) for name in message.__slots__ if name not in ('names', 'value_count', 'values')}
    return {**row, **dict(zip(filter(None, message.names.split(',')), message.values))}


def type_of(data: bytes) -> str:
    """The name of our type as which a message begins; empty for another's."""
    return getattr(_BY_FINGERPRINT.get(bytes(data[:8])), '__name__', '')


def messages_of(run: Any) -> Iterator[tuple[int, str, bytes]]:
    """(run time in us, channel, data) of the messages that a Run's summary, rows and events make."""
    experiment, telemetry, event = (TYPES[name]() for name in ('experiment_t', 'telemetry_t', 'event_t'))
    for name in ('experiment', 'controller', 'plant', 'backend', 'version'):
        setattr(experiment, name, str(run.summary.get(name) or ''))
    experiment.config_json = json.dumps(run.summary.get('config') or {})
    yield 0, 'ABS_EXPERIMENT', experiment.encode()
    telemetry.names, telemetry.value_count = ','.join(run.signals), len(run.signals)
    fields = {name: type(getattr(telemetry, name)) for name in telemetry.__slots__ if name in run.columns and name != 'phase'}
    waiting = list(run.events)
    for row, (time_s, phase) in enumerate(zip(run['time_s'].tolist(), run['phase'])):
        telemetry.cycle = telemetry.sequence = row
        telemetry.stamp_ns, telemetry.phase = round(time_s * 1e9), PHASES.index(phase) if phase in PHASES else 0
        for name, kind in fields.items():
            value = run[name][row]
            setattr(telemetry, name, kind(0 if kind is int and value != value else value))
        telemetry.values = [float(run[name][row]) for name in run.signals]
        yield round(time_s * 1e6), 'ABS_TELEMETRY', telemetry.encode()
        while waiting and waiting[0].time_s <= time_s:
            happened = waiting.pop(0)
            event.time_s, event.kind, event.message, event.reason_text = time_s, happened.event, happened.text, happened.reason
            yield round(time_s * 1e6), 'ABS_EVENT', event.encode()


def decode(data: bytes) -> Any:
    """Decodes the message in `data` of any type. Raises ValueError if it is damaged or not from abs_hil."""
    if (type_ := _BY_FINGERPRINT.get(bytes(data[:8]))) is None:
        raise ValueError(f'not a message of abs_hil: fingerprint {bytes(data[:8]).hex()}, known are '
                         + ', '.join(f'{name} {t._get_packed_fingerprint().hex()}' for name, t in TYPES.items()))
    try:
        message = type_.decode(data)
    except Exception as error:  # the generated decoders raise struct.error and UnicodeDecodeError
        raise ValueError(f'damaged {type_.__name__} of {len(data)} bytes: {error}') from error
    if message.encode() != bytes(data):  # the decoders accept a last string that is cut short, and bytes after the end
        raise ValueError(f'damaged {type_.__name__} of {len(data)} bytes: its length is not that of its fields')
    return message


def live(url: str = '', *, channel: str = 'TELEMETRY', prefix: str = 'ABS_', timeout_s: float | None = None) -> Iterator[Any]:
    """Yields the messages of a running experiment as they come: by default one telemetry_t a cycle.

    url:       the LCM network; empty: LCM_DEFAULT_URL, else UDP multicast within this computer.
    channel:   TELEMETRY, STATUS, EVENT, EXPERIMENT, ...; the run's telemetry.channel_prefix stands before it.
    timeout_s: ends the iteration after this time without a message; None waits for ever.

    Subscribes at once. Messages that are damaged or of another type are left out. Raises OSError without a network and
    ValueError for a URL that is none.
    """
    from .core import load_network  # decoding needs Python alone
    subscription = load_network('abs_hil.live').Subscription(url, re.escape(prefix + channel))

    def messages() -> Iterator[Any]:
        while True:
            if (received := subscription.next(1.0 if timeout_s is None else timeout_s)) is not None:
                with contextlib.suppress(ValueError):
                    yield decode(received[1])
            elif timeout_s is not None:
                return
    return messages()
