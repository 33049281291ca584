"""Writes runs to MCAP: chunks compressed with zstd, an index, attachments, metadata."""
from collections.abc import Sequence
from typing import IO, Any

import numpy as np

from . import messages

CHUNK_BYTES = 1 << 20


class McapFile:
    """An MCAP file with flat structs of float64 and log messages. It is whole after `finish`.

    Raises ImportError without the package mcap.
    """

    def __init__(self, file: IO[bytes], library: str) -> None:
        from mcap.writer import CompressionType, IndexType, Writer
        self._writer: Any = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD,
                                   index_types=IndexType.ALL, enable_crcs=True)
        self._writer.start(profile='ros2', library=library)
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}

    def add_topic(self, topic: str, type_name: str, definition: str) -> None:
        schema = self._writer.register_schema(name=type_name, encoding='ros2msg', data=definition.encode())
        self._channels[topic] = self._writer.register_channel(topic=topic, message_encoding='cdr', schema_id=schema)
        self._sequence[topic] = 0

    def add_struct(self, topic: str, type_name: str, fields: Sequence[tuple[str, str]]) -> None:
        """A topic of flat structs from (column, comment) of their fields."""
        self.add_topic(topic, type_name, messages.definition(fields))

    def has(self, topic: str) -> bool:
        return topic in self._channels

    def wants(self, topic: str) -> bool:
        return True

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        self._writer.add_message(channel_id=self._channels[topic], log_time=time_ns, publish_time=time_ns, data=data,
                                 sequence=self._sequence[topic])
        self._sequence[topic] += 1

    def write_rows(self, topic: str, times_ns: np.ndarray, columns: Sequence[np.ndarray]) -> None:
        for time_ns, data in zip(times_ns.tolist(), messages.rows(columns)):
            self.write(topic, time_ns, data)

    def log(self, topic: str, time_ns: int, level: int, name: str, text: str) -> None:
        if not self.has(topic):
            self.add_topic(topic, messages.LOG_TYPE, messages.LOG_DEFINITION)
        self.write(topic, time_ns, messages.log(time_ns, level, name, text))

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        self._writer.add_attachment(create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data)

    def describe(self, name: str, data: dict[str, str]) -> None:
        self._writer.add_metadata(name=name, data=data)

    def finish(self) -> None:
        self._writer.finish()
