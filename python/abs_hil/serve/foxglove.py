"""The same messages as an MCAP file's (interchange/running.py), live, for Foxglove, Lichtblick and PlotJuggler: the protocol
foxglove.sdk.v1 by the package foxglove-sdk, whose threads are this process's only."""
from typing import Any

from ..interchange import messages
from ..interchange.mcap_file import EVENT_TOPIC
from ..interchange.running import Translator
from ..places import how_to_install

#: the protocol knows no token, so other computers get in by ssh only
HOST = '127.0.0.1'
#: messages that wait for one viewer, 8 s at 1 kHz; the oldest give way
BACKLOG = 8192
#: the package keeps a closed channel's object, so a hostile network may not open ever more
MOST_CHANNELS = 1000


class Foxglove(Translator):
    """Serves from now on. Raises ImportError without the package, OSError if the port cannot be used."""

    def __init__(self, port: int) -> None:
        self._channels = Channels(port)
        super().__init__(self._channels)
        self._channels.add(EVENT_TOPIC, messages.LOG_TYPE, messages.LOG_DEFINITION)  # now, so that a viewer gets the first one
        self.link = f'ws://{HOST}:{self._channels.server.port}'

    def stop(self) -> None:
        self._channels.server.stop()


class Channels(messages.Topics):
    """The topics of one server."""

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
