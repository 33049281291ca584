"""Converts recorded runs."""
import json

import numpy as np

from . import source as sources
from .mcap_file import McapFile
from .source import Source

CYCLE_TOPIC, SIGNALS_TOPIC, EVENT_TOPIC = '/abs_hil/cycle', '/abs_hil/signals', '/abs_hil/event'
CYCLE_TYPE, SIGNALS_TYPE = 'abs_hil/msg/Cycle', 'abs_hil/msg/Signals'


def to_mcap(source: Source, name: str) -> None:
    """Writes the file. Raises ImportError without the package mcap."""
    with open(name, 'wb') as file:
        mcap = McapFile(file, library='abs_hil')
        times_ns, columns, signals = source.times_ns, source.numbers(), source.run.signals
        for topic, type_name, names in ((CYCLE_TOPIC, CYCLE_TYPE, tuple(columns)), (SIGNALS_TOPIC, SIGNALS_TYPE, signals)):
            if names:
                mcap.add_struct(topic, type_name, [(field, sources.comment(field)) for field in names])
        for event in source.events:
            mcap.log(EVENT_TOPIC, source.start_ns + round(event.time_s * 1e9), sources.LEVELS.get(event.kind, 20), event.kind,
                     event.text)
        mcap.write_rows(CYCLE_TOPIC, times_ns, list(columns.values()))
        if signals:
            values = [source.run.columns[field] for field in signals]
            known = ~np.all(np.isnan(np.column_stack(values)), axis=1)
            mcap.write_rows(SIGNALS_TOPIC, times_ns[known], [column[known] for column in values])
        for attached, data in source.attachments.items():
            suffix = attached[attached.rfind('.'):]
            mcap.attach(attached, sources.MEDIA_TYPES[suffix], data, source.start_ns)
        mcap.describe('abs_hil', source.metadata())
        mcap.finish()


def to_parquet(source: Source, name: str) -> None:
    """Writes the columns of the CSV, with texts as texts; the attachments are in the schema's metadata. Raises ImportError
    without the package pyarrow."""
    import pyarrow
    import pyarrow.parquet
    table = pyarrow.table({column: pyarrow.array(values.tolist() if values.dtype == object else values)
                           for column, values in source.run.columns.items()})
    metadata = {f'abs_hil.{key}': value.encode() for key, value in source.metadata().items()}
    metadata.update((f'abs_hil.{key}', data) for key, data in source.attachments.items())
    metadata['abs_hil.units'] = json.dumps({column: sources.comment(column) for column in table.column_names}).encode()
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), name, compression='zstd')
