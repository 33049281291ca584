"""What an MCAP file of ours holds: its messages as columns, events, attachments; of any file its topics."""
import dataclasses
import pathlib

import numpy as np

from ..messages import PHASES
from .messages import columns_of, log_of

CYCLE_TOPIC, SIGNALS_TOPIC, EVENT_TOPIC = '/abs_hil/cycle', '/abs_hil/signals', '/abs_hil/event'


@dataclasses.dataclass
class Topic:
    """type: its schema's name. columns: of ours. times_ns: Unix times of its messages; data: theirs, of ours alone."""
    name: str
    type: str
    columns: list[str]
    times_ns: list[int] = dataclasses.field(default_factory=list)
    data: list[bytes] = dataclasses.field(default_factory=list)
    bytes: int = 0


@dataclasses.dataclass
class McapContent:
    """topics: by number of the channel. damage: why the rest is not read; empty: nothing is missing."""
    place: pathlib.Path
    topics: dict[int, Topic] = dataclasses.field(default_factory=dict)
    events: list[tuple[int, str, str]] = dataclasses.field(default_factory=list)
    metadata: dict[str, str] = dataclasses.field(default_factory=dict)
    attachments: dict[str, bytes] = dataclasses.field(default_factory=dict)
    times_ns: np.ndarray = dataclasses.field(default_factory=lambda: np.empty(0, dtype=np.int64))
    damage: str = ''

    def columns(self) -> dict[str, np.ndarray]:
        """The columns of the cycles, phases as names; if there are several runs, `run` has their numbers. Sets times_ns.
        Raises ValueError for a file without cycles."""
        topics = [topic for topic in self.topics.values() if topic.data]
        cycles = next((topic for topic in topics if topic.name == CYCLE_TOPIC), None)
        if cycles is None:
            held = ', '.join(sorted({topic.name for topic in self.topics.values()})) or 'nothing'
            raise ValueError(f'"{self.place}" holds no topic {CYCLE_TOPIC} with cycles of abs_hil, but {held}'
                             + f'; it is cut off or damaged: {self.damage}' * bool(self.damage))
        self.times_ns, found = _table(cycles)
        size = len(self.times_ns)
        for topic in topics:
            if topic.name == SIGNALS_TOPIC:
                times_ns, signals = _table(topic)
                places = np.minimum(np.searchsorted(self.times_ns, times_ns), size - 1)
                fits = self.times_ns[places] == times_ns
                for name, values in signals.items():
                    found.setdefault(name, np.full(size, np.nan))[places[fits]] = values[fits]
        for column, texts in (('phase', list(PHASES)), ('phase_name', self.metadata.get('phase_names', '').split(','))):
            if column in found:
                numbers = np.nan_to_num(found[column], nan=-1.0)
                known = (numbers >= 0) & (numbers < len(texts))
                found[column] = np.array([*texts, ''], dtype=object)[np.where(known, numbers, -1).astype(int)]
        if (back := np.diff(found['time_s'], prepend=-np.inf) < 0).any():
            found['run'] = np.cumsum(back)
        return found


def _table(topic: Topic) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    values = np.frombuffer(b''.join(topic.data), dtype='<f8').reshape(len(topic.data), -1)
    return np.array(topic.times_ns), {name: values[:, n].astype(float) for n, name in enumerate(topic.columns)}


def mcap_file(place: pathlib.Path) -> McapContent:
    """Reads a file, whole or cut off. Raises ImportError without the package mcap."""
    from mcap.stream_reader import StreamReader
    content, schemas = McapContent(place), {}
    with open(place, 'rb') as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                kind = type(record).__name__
                if kind == 'Schema':
                    schemas[record.id] = record
                elif kind == 'Channel':
                    schema = schemas.get(record.schema_id)
                    columns = columns_of(schema.data.decode()) if record.topic in (CYCLE_TOPIC, SIGNALS_TOPIC) else []
                    content.topics.setdefault(record.id, Topic(record.topic, schema.name if schema else '', columns))
                elif kind == 'Message':
                    topic = content.topics[record.channel_id]
                    topic.times_ns.append(record.log_time)
                    topic.bytes += len(record.data)
                    if topic.columns:
                        if len(record.data) != 4 + 8 * len(topic.columns):
                            raise ValueError(f'a message of {topic.name} has {len(record.data)} bytes')
                        topic.data.append(record.data[4:])
                    elif topic.name == EVENT_TOPIC:
                        content.events.append((record.log_time, *log_of(record.data)))
                elif kind == 'Attachment':
                    content.attachments[record.name] = record.data
                elif kind == 'Metadata' and record.name == 'abs_hil':
                    content.metadata = record.metadata
        except Exception as error:  # the package lets out its own kinds, zstd's and struct's
            content.damage = str(error) or type(error).__name__
    return content
