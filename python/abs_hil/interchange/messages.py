"""ROS 2 messages of runs: their definitions, their bytes in CDR (little endian), and MCAP files of them.

All but the log's are flat structs of float64. Both PlotJuggler and Foxglove read these.
"""
import re
import struct
from collections.abc import Iterable, Sequence
from typing import IO, Any

import numpy as np

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
    taken: dict[str, str] = {}
    for column in columns:
        base = re.sub('_+', '_', column.lower()).strip('_')
        name = base if base[:1].isalpha() else f'x_{base}'.rstrip('_')
        number = 2
        while name in taken.values():
            name, number = f'{base}_{number}', number + 1
        taken[column] = name
    return taken


def definition(fields: Iterable[tuple[str, str]]) -> str:
    """The definition of a flat struct from (column, comment) of its fields."""
    comments = dict(fields)
    return ''.join(f'float64 {name}  # {column}: {comments[column]}'.rstrip(': ') + '\n'
                   for column, name in field_names(comments).items())


def columns_of(text: str) -> list[str]:
    """The columns in a definition."""
    return re.findall(r'^float64 \w+  # ([^:\n]*)', text, re.MULTILINE)


def rows(columns: Sequence[np.ndarray]) -> list[bytes]:
    """One message a row of the columns, all of shape (rows,)."""
    table = np.column_stack([np.asarray(column, dtype='<f8') for column in columns])
    return [_LITTLE_ENDIAN + row.tobytes() for row in table]


def row(values: Sequence[float]) -> bytes:
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
        for time_ns, data in zip(times_ns.tolist(), rows(columns)):
            self.write(topic, time_ns, data)

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        self._writer.add_attachment(create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data)

    def describe(self, name: str, data: dict[str, str]) -> None:
        self._writer.add_metadata(name=name, data=data)

    def finish(self) -> None:
        self._writer.finish()
