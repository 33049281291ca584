"""What an MCAP file holds: of ours the rows, events and attachments; of any its topics."""
import dataclasses
import pathlib
from typing import Any

import numpy as np

from ..messages import PHASES
from .messages import columns_of

CYCLE_TOPIC, SIGNALS_TOPIC, EVENT_TOPIC = '/abs_hil/cycle', '/abs_hil/signals', '/abs_hil/event'


@dataclasses.dataclass
class Topic:
    """type: its schema's name. times_ns: Unix times of its messages. bytes: of all of them. data: of ours, the messages."""
    name: str
    type: str
    columns: list[str]
    times_ns: list[int] = dataclasses.field(default_factory=list)
    data: list[bytes] = dataclasses.field(default_factory=list)
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
