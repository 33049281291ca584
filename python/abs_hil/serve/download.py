"""What the page shows, as a file: the rows of a run's CSV, or the same as MCAP."""
import csv
import io
import pathlib
import tempfile

import numpy as np

from ..messages import PHASES, QUANTITIES
from .history import COLUMNS, PLACE
from .runs import RunFacts

TYPES = {'csv': 'text/csv', 'mcap': 'application/octet-stream'}
_CSV = tuple(sorted((name for name in COLUMNS if QUANTITIES[name]['csv_column'] is not None),
                    key=lambda name: int(QUANTITIES[name]['csv_column'])))


def make(kind: str, run: RunFacts, rows: np.ndarray) -> bytes:
    """The bytes of a file. Raises ImportError without the package mcap."""
    text = as_csv(run, rows)
    if kind == 'csv':
        return text.encode()
    from ..interchange import recorded, source
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder, f'run-{run.number}.csv')
        place.write_text(text)
        read = source.read(str(place))
        read.events = [source.Event(event['time_s'], event['kind'], event['text']) for event in run.events]
        recorded.to_mcap(read, str(place.with_suffix('.mcap')))
        return place.with_suffix('.mcap').read_bytes()


def as_csv(run: RunFacts, rows: np.ndarray) -> str:
    """The columns of --csv, bit-exactly, and the controller's own signals."""
    written = io.StringIO()
    writer = csv.writer(written, lineterminator='\n')
    writer.writerow([*_CSV, *run.own])
    places = [*(PLACE[name] for name in _CSV), *range(len(COLUMNS), len(COLUMNS) + len(run.own))]
    phase = _CSV.index('phase')
    for row in rows[:, places].tolist():
        fields = [_as_text(value) for value in row]
        fields[phase] = PHASES[int(row[phase])] if 0 <= row[phase] < len(PHASES) else 'fault'
        writer.writerow(fields)
    return written.getvalue()


def _as_text(value: float) -> str:
    return 'NaN' if value != value else repr(value).removesuffix('.0')
