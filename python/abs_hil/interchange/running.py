"""The messages of a running experiment as topics for other tools, live or recorded into MCAP."""
import math
import re
import time
from collections.abc import Iterator
from typing import Any

from ..core import _core, load_network
from ..messages import MOST_SIGNALS, QUANTITIES, decode, row_of
from ..places import how_to_install
from ..run import COLUMNS
from .messages import CYCLE_TOPIC, EVENT_TOPIC, LOG_DEFINITION, LOG_TYPE, SIGNALS_TOPIC, McapFile, Topics, row_bytes
from .recorded import CYCLE_TYPE, LAST_NS, LEVELS, SIGNALS_TYPE, comment

STATUS_TOPIC, STATUS_TYPE = '/abs_hil/status', 'abs_hil/msg/Status'
#: the protocol knows no token, so other computers get in by ssh only
HOST = '127.0.0.1'
#: messages that wait for one viewer, 8 s at 1 kHz; the oldest give way
BACKLOG = 8192
#: the package keeps a closed channel's object, so a hostile network may not open ever more
MOST_CHANNELS = 1000


def received(url: str, prefix: str, idle_s: float | None, seconds: float | None) -> Iterator[tuple[str, Any]]:
    """(channel without prefix, message or None if damaged) as they come. Ends after `idle_s` without a message once one
    has come, after `seconds`, or by an interrupt."""
    subscription = load_network('abs_hil convert --live').Subscription(url, re.escape(prefix) + '.*')
    end, heard = time.monotonic() + (math.inf if seconds is None else seconds), math.inf
    while time.monotonic() < end:
        if (packet := subscription.next(0.2)) is not None:
            heard = time.monotonic()
            try:
                yield packet[0][len(prefix):], decode(packet[1])
            except ValueError:
                yield packet[0][len(prefix):], None
        elif idle_s is not None and time.monotonic() > heard + idle_s:
            return


class Translator:
    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._topics.add_struct(CYCLE_TOPIC, CYCLE_TYPE, [(name, comment(name)) for name in COLUMNS])
        self._last_ns = 0  # Unix time of the last row
        self._offset_ns: int | None = None  # from the run's clock to Unix time
        self._names = ''
        self._signals: list[str] = []
        self._cycle = -1

    def translate(self, message: Any) -> None:
        if (handler := getattr(self, f'_{type(message).__name__}', None)) is not None:
            handler(message)

    def _time_ns(self, stamp_ns: int) -> int:
        """Unix time: that of the arrival of a run's first cycle, then the run's own clock."""
        if self._offset_ns is None:
            self._offset_ns = time.time_ns() - stamp_ns
        return max(0, min(stamp_ns + self._offset_ns, LAST_NS))

    def _telemetry_t(self, message: Any) -> None:
        if message.cycle <= self._cycle:
            self._offset_ns = None  # another run, perhaps of another computer
        self._cycle = message.cycle
        self._last_ns = self._time_ns(message.stamp_ns)
        if message.names != self._names:
            self._names = message.names
            self._signals = [name for name in row_of(message) if name not in QUANTITIES and _core.is_signal_name(name)
                             and name not in message.__slots__][:MOST_SIGNALS]
            if self._signals:
                self._topics.add_struct(SIGNALS_TOPIC, SIGNALS_TYPE, [(name, comment(name)) for name in self._signals])
        wanted = [self._topics.wants(topic) for topic in (CYCLE_TOPIC, SIGNALS_TOPIC)]
        if not any(wanted):
            return
        row = row_of(message)
        if wanted[0]:
            values = [float(row.get(name, math.nan)) for name in COLUMNS]
            self._topics.write(CYCLE_TOPIC, self._last_ns, row_bytes(values))
        values = [float(row.get(name, math.nan)) for name in self._signals]
        if wanted[1] and not all(map(math.isnan, values)):
            self._topics.write(SIGNALS_TOPIC, self._last_ns, row_bytes(values))

    def _status_t(self, message: Any) -> None:
        values = {name: float(getattr(message, name)) for name in message.__slots__}
        if STATUS_TOPIC not in self._topics.channels:
            self._topics.add_struct(STATUS_TOPIC, STATUS_TYPE,
                                    [(name, comment(name) if name in QUANTITIES else '') for name in values])
        self._topics.write(STATUS_TOPIC, self._time_ns(message.stamp_ns), row_bytes(list(values.values())))

    def _event_t(self, message: Any) -> None:
        text = message.message or message.reason_text
        self._topics.log(EVENT_TOPIC, self._time_ns(message.stamp_ns), LEVELS.get(message.kind, 20), message.kind, text)


class Recorder(Translator):
    """Puts messages into a file, and counts what is missing."""

    def __init__(self, mcap: McapFile) -> None:
        super().__init__(mcap)
        self._mcap = mcap
        self._sequence: dict[str, int] = {}
        self.experiment: Any = None
        self.rows = self.lost = self.damaged = 0

    def take(self, channel: str, message: Any) -> None:
        if message is None:
            self.damaged += 1
            return
        kind = type(message).__name__
        if hasattr(message, 'sequence') and kind != 'command_state_t':
            self.lost += max(message.sequence - self._sequence.get(channel, message.sequence) - 1, 0)
            self._sequence[channel] = message.sequence
        self.rows += kind == 'telemetry_t'
        if kind == 'experiment_t':
            self.experiment = message
        self.translate(message)

    def finish(self) -> None:
        if self.experiment is not None:
            self._mcap.attach('config.json', 'application/json', self.experiment.config_json.encode(), self._last_ns)
        names = ('experiment', 'controller', 'plant', 'backend', 'version')
        facts = {name: str(getattr(self.experiment, name)) for name in names} if self.experiment is not None else {}
        self._mcap.describe('abs_hil', {'source': 'live', 'rows': str(self.rows), 'lost_messages': str(self.lost),
                                        'damaged_messages': str(self.damaged), **facts})
        self._mcap.finish()


class Foxglove(Topics):
    """The same messages as an MCAP file's, live, for Foxglove, Lichtblick and PlotJuggler: the protocol foxglove.sdk.v1 by the
    package foxglove-sdk, whose threads are this process's only. Serves from now on. Raises ImportError without the package,
    OSError if the port cannot be used."""

    def __init__(self, port: int) -> None:
        try:
            import foxglove
        except ImportError as error:
            raise ImportError(f'--foxglove needs the Python package foxglove-sdk ({error}); install it: '
                              f'{how_to_install("foxglove-sdk")}') from None
        super().__init__()
        self._package: Any = foxglove
        self._context: Any = foxglove.Context()
        self._made = 0
        try:
            # Without capabilities: a client can send nothing but what it wants to see.
            self.server: Any = foxglove.start_server(name='abs_hil', host=HOST, port=port, capabilities=[],
                                                     context=self._context, message_backlog_size=BACKLOG)
        except RuntimeError as error:
            raise OSError(f'--foxglove cannot listen at {HOST}, port {port}: {error}; give another port') from None
        self.link = f'ws://{HOST}:{self.server.port}'
        self.translate = Translator(self).translate
        self.add(EVENT_TOPIC, LOG_TYPE, LOG_DEFINITION)  # now, so that a viewer gets the first one

    def wants(self, topic: str) -> bool:
        return topic in self.channels and bool(self.channels[topic].has_sinks())

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        if topic in self.channels:
            self.channels[topic].log(data, log_time=time_ns)

    def add(self, topic: str, type_name: str, definition: str) -> None:
        """A topic that exists already gets another definition."""
        if topic in self.channels:
            self.channels.pop(topic).close()
        if self._made == MOST_CHANNELS:
            return
        self._made += 1
        schema = self._package.Schema(name=type_name, encoding='ros2msg', data=definition.encode())
        self.channels[topic] = self._package.Channel(topic, message_encoding='cdr', schema=schema, context=self._context)
