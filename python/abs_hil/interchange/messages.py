"""ROS 2 messages of runs: their definitions, their bytes in CDR (little endian), and MCAP files of them, to write and to read.

All but the log's are flat structs of float64. Both PlotJuggler and Foxglove read these.
"""
import pathlib
import re
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np

from ..messages import PHASES
from ..run import names_apart

CYCLE_TOPIC, SIGNALS_TOPIC, EVENT_TOPIC = '/abs_hil/cycle', '/abs_hil/signals', '/abs_hil/event'
_LITTLE_ENDIAN = b'\x00\x01\x00\x00'

#: rcl_interfaces/msg/Log, which Foxglove shows as a log
LOG_TYPE = 'rcl_interfaces/msg/Log'
LOG_DEFINITION = """\
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
CHUNK_BYTES = 1 << 20


def field_names(columns: Iterable[str]) -> dict[str, str]:
    """column -> name of its field. ROS 2 allows lower-case letters, digits and single '_' within a name only."""
    known = list(columns)
    bases = [re.sub('_+', '_', column.lower()).strip('_') for column in known]
    return dict(zip(known, names_apart((base if base[:1].isalpha() else f'x_{base}'.rstrip('_') for base in bases), '{}_{}')))


def definition(fields: Iterable[tuple[str, str]]) -> str:
    """The definition of a flat struct from (column, comment) of its fields."""
    comments = dict(fields)
    return ''.join(f'float64 {name}  # {column}: {comments[column]}'.rstrip(': ') + '\n'
                   for column, name in field_names(comments).items())


def columns_of(text: str) -> list[str]:
    """The columns in a definition."""
    return re.findall(r'^float64 \w+  # ([^:\n]*)', text, re.MULTILINE)


def row_bytes(values: Sequence[float]) -> bytes:
    return _LITTLE_ENDIAN + struct.pack(f'<{len(values)}d', *values)


def log(stamp_ns: int, level: int, name: str, text: str) -> bytes:
    body = struct.pack('<iIB', stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000, level)
    for word in (name, text, '', ''):
        data = word.encode() + b'\0'
        body += b'\0' * (-len(body) % 4) + struct.pack('<I', len(data)) + data
    return _LITTLE_ENDIAN + body + b'\0' * (-len(body) % 4) + struct.pack('<I', 0)


def log_of(data: bytes) -> tuple[str, ...]:
    """(name, text) of a message that `log` made."""
    body, place, texts = data[len(_LITTLE_ENDIAN):], struct.calcsize('<iIB'), []
    for _ in range(2):
        place += -place % 4
        size, = struct.unpack_from('<I', body, place)
        texts.append(body[place + 4:place + 3 + size].decode(errors='replace'))
        place += 4 + size
    return tuple(texts)


class Topics:
    """Where messages go, by topic: an MCAP file, or the channels of a server."""

    def __init__(self) -> None:
        self.channels: dict[str, Any] = {}

    def add(self, topic: str, type_name: str, definition: str) -> None:
        raise NotImplementedError

    def add_struct(self, topic: str, type_name: str, fields: Sequence[tuple[str, str]]) -> None:
        """A topic of flat structs from (column, comment) of their fields."""
        self.add(topic, type_name, definition(fields))

    def wants(self, topic: str) -> bool:
        """Whether anybody reads it."""
        return True

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        raise NotImplementedError

    def log(self, topic: str, time_ns: int, level: int, name: str, text: str) -> None:
        if topic not in self.channels:
            self.add(topic, LOG_TYPE, LOG_DEFINITION)
        self.write(topic, time_ns, log(time_ns, level, name, text))


class McapFile(Topics):
    """An MCAP file: chunks compressed with zstd, an index, attachments, metadata. It is whole after `finish`.

    Raises ImportError without the package mcap.
    """

    def __init__(self, file: IO[bytes], library: str) -> None:
        from mcap.writer import CompressionType, IndexType, Writer
        super().__init__()
        self._writer: Any = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD,
                                   index_types=IndexType.ALL, enable_crcs=True)
        self._writer.start(profile='ros2', library=library)
        self._sequence: dict[str, int] = {}

    def add(self, topic: str, type_name: str, definition: str) -> None:
        schema = self._writer.register_schema(name=type_name, encoding='ros2msg', data=definition.encode())
        self.channels[topic] = self._writer.register_channel(topic=topic, message_encoding='cdr', schema_id=schema)
        self._sequence[topic] = 0

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        self._writer.add_message(channel_id=self.channels[topic], log_time=time_ns, publish_time=time_ns, data=data,
                                 sequence=self._sequence[topic])
        self._sequence[topic] += 1

    def write_rows(self, topic: str, times_ns: np.ndarray, columns: Sequence[np.ndarray]) -> None:
        """One message a row of the columns, all of shape (rows,)."""
        for time_ns, values in zip(times_ns.tolist(), np.column_stack(columns).astype('<f8')):
            self.write(topic, time_ns, _LITTLE_ENDIAN + values.tobytes())

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        self._writer.add_attachment(create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data)

    def describe(self, name: str, data: dict[str, str]) -> None:
        self._writer.add_metadata(name=name, data=data)

    def finish(self) -> None:
        self._writer.finish()


@dataclass
class Topic:
    """type: its schema's name. times_ns: Unix times of its messages. bytes: of all of them. data: of ours, the messages."""
    name: str
    type: str
    columns: list[str]
    times_ns: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)
    bytes: int = 0


class McapContent:
    """topics: by number of the channel. damage: why the rest is not read; empty: nothing is missing. Raises ImportError without
    the package mcap."""

    def __init__(self, place: pathlib.Path) -> None:
        from mcap.stream_reader import StreamReader
        self.place, self.damage = place, ''
        self.topics: dict[int, Topic] = {}
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        schemas: dict[int, Any] = {}
        record: Any
        with open(place, 'rb') as file:
            try:
                for record in StreamReader(file, validate_crcs=True).records:
                    kind = type(record).__name__
                    if kind == 'Schema':
                        schemas[record.id] = record
                    elif kind == 'Channel':
                        schema = schemas.get(record.schema_id)
                        rows = record.topic in (CYCLE_TOPIC, SIGNALS_TOPIC)
                        self.topics.setdefault(record.id, Topic(record.topic, schema.name if schema else '',
                                                                columns_of(schema.data.decode()) if rows and schema else []))
                    elif kind == 'Message':
                        self._take(self.topics[record.channel_id], record.log_time, record.data)
                    elif kind == 'Attachment':
                        self.attachments[record.name] = record.data
                    elif kind == 'Metadata' and record.name == 'abs_hil':
                        self.metadata = record.metadata
            except Exception as error:  # the package lets out its own kinds, zstd's and struct's
                self.damage = str(error) or type(error).__name__

    def _take(self, topic: Topic, time_ns: int, data: bytes) -> None:
        if topic.columns and len(data) != 4 + 8 * len(topic.columns):
            raise ValueError(f'a message of {topic.name} has {len(data)} bytes')
        topic.times_ns.append(time_ns)
        topic.bytes += len(data)
        if topic.columns or topic.name == EVENT_TOPIC:
            topic.data.append(data)

    def columns(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """The columns of the cycles, with phases as names and, if there are several runs, their numbers as `run`; and the rows'
        Unix times. Raises ValueError for a file without cycles."""
        tables = [(topic.name, *_table(topic)) for topic in self.topics.values() if topic.columns and topic.data]
        found, times_ns = next((table[1:] for table in tables if table[0] == CYCLE_TOPIC), (None, np.empty(0)))
        if found is None:
            held = ', '.join(sorted({topic.name for topic in self.topics.values()})) or 'nothing'
            raise ValueError(f'"{self.place}" holds no topic {CYCLE_TOPIC} with cycles of abs_hil, but {held}'
                             + f'; it is cut off or damaged: {self.damage}' * bool(self.damage))
        for _, signals, own_ns in (table for table in tables if table[0] == SIGNALS_TOPIC):
            places = np.minimum(np.searchsorted(times_ns, own_ns), len(times_ns) - 1)
            fits = times_ns[places] == own_ns
            for name, values in signals.items():
                found.setdefault(name, np.full(len(times_ns), np.nan))[places[fits]] = values[fits]
        for column, texts in (('phase', [*PHASES]), ('phase_name', self.metadata.get('phase_names', '').split(','))):
            if column in found:
                numbers = np.nan_to_num(found[column], nan=-1.0)
                known = (numbers >= 0) & (numbers < len(texts))
                found[column] = np.array([*texts, ''], dtype=object)[np.where(known, numbers, -1).astype(int)]
        if (back := np.diff(found['time_s'], prepend=-np.inf) < 0).any():
            found['run'] = np.cumsum(back)
        return found, times_ns


def _table(topic: Topic) -> tuple[dict[str, np.ndarray], np.ndarray]:
    values = np.frombuffer(b''.join(data[4:] for data in topic.data), dtype='<f8').reshape(len(topic.data), -1)
    return {name: values[:, n].astype(float) for n, name in enumerate(topic.columns)}, np.array(topic.times_ns)
