"""What the page shows, as a file: the rows of a run's CSV, or the same as MCAP."""
import pathlib
import tempfile

import numpy as np

from ..messages import PHASES, QUANTITIES
from ..run import csv_bytes, phase_names
from .history import COLUMNS, PLACE
from .runs import RunFacts

TYPES = {'csv': 'text/csv', 'mcap': 'application/octet-stream'}
_CSV = tuple(sorted((name for name in COLUMNS if QUANTITIES[name]['csv_column'] is not None),
                    key=lambda name: int(QUANTITIES[name]['csv_column'])))


def make(kind: str, run: RunFacts, rows: np.ndarray) -> bytes:
    """The bytes of a file: CSV has the columns of --csv, bit-exactly, and the controller's own signals. Raises ImportError
    without the package mcap."""
    columns = {name: rows[:, PLACE[name]] for name in _CSV} | dict(zip(run.own, rows[:, len(COLUMNS):].T))
    phase = columns['phase']
    columns['phase'] = phase_names(np.where((phase >= 0) & (phase < len(PHASES)), phase, PHASES.index('fault')))
    written = csv_bytes(columns)
    if kind == 'csv':
        return written
    from ..interchange import recorded
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder, f'run-{run.number}.csv')
        place.write_bytes(written)
        read = recorded.read(str(place))
        read.events = [recorded.Event(event['time_s'], event['kind'], event['text']) for event in run.events]
        recorded.to_mcap(read, str(place.with_suffix('.mcap')))
        return place.with_suffix('.mcap').read_bytes()
