"""The rows of runs in other formats: CSV, JSON, MAT-files, Parquet."""
import json
import math
import re
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

from ..rows import TEXTS
from ..run import csv_bytes
from .files import RunFiles

_FIELD_CHARACTERS = 63  # of names in Octave and MATLAB


class Exporter:
    """Writes the chosen columns of runs; `notes` says what is missing."""

    def __init__(self, runs: list[RunFiles], columns: list[str]) -> None:
        self.runs = runs
        self.notes: list[str] = []
        self._chosen = columns
        self._columns = columns or list(dict.fromkeys(name for run in runs for name in run.rows().columns))

    def write(self, kind: str, out: BinaryIO) -> None:
        {'csv': self._csv, 'json': self._json, 'octave': self._octave, 'parquet': self._parquet}[kind](out)

    def _tables(self) -> Iterator[tuple[RunFiles, dict[str, np.ndarray]]]:
        """Each run with those of the columns that it has; phases as an array of names."""
        for run in self.runs:
            rows = run.rows()
            for name in self._chosen:
                if name not in rows.columns:
                    raise ValueError(f'{run.source}: no column "{name}"; the file has the columns {", ".join(rows.columns)}')
            if rows.truncated:
                self.notes.append(f'{run.source}: the last row is incomplete, as after a crash, and is left out')
            yield run, {name: rows.columns[name] for name in self._chosen or rows.columns}

    def _csv(self, out: BinaryIO) -> None:
        for number, (run, columns) in enumerate(self._tables()):
            size = len(next(iter(columns.values())))
            every = {name: columns.get(name, np.full(size, '', object) if name in TEXTS else np.full(size, np.nan))
                     for name in self._columns}
            out.write(csv_bytes({'run': np.full(size, run.name, dtype=object), **every}, header=number == 0))

    def _json(self, out: BinaryIO) -> None:
        out.write(b'{"runs": [')
        for number, (run, columns) in enumerate(self._tables()):
            data = {'name': run.name, 'label': run.label, 'summary': run.summary,
                    'columns': {name: _without_nan(values) for name, values in columns.items()}}
            out.write((',\n' if number else '\n').encode() + json.dumps(data, ensure_ascii=False).encode())
        out.write(b'\n]}\n')

    def _octave(self, out: BinaryIO) -> None:
        import scipy.io
        texts = ('name', 'label', 'controller', 'plant', 'result')
        fields = [*texts, 'phase_names', *(_field_name(name) for name in self._columns)]
        runs = np.empty((1, len(self.runs)), dtype=[(name, object) for name in fields])
        for number, (run, columns) in enumerate(self._tables()):
            record = runs[0, number]
            for name, text in zip(texts, (run.name, run.label, run.text('controller'), run.text('plant'),
                                          run.text('result'))):
                record[name] = _ascii(text)
            phases = list(dict.fromkeys(text for name in TEXTS if name in columns for text in columns[name].tolist()))
            record['phase_names'] = np.array([[_ascii(phase) for phase in phases]], dtype=object)
            for name in self._columns:
                values = columns.get(name, np.empty(0))
                if name in TEXTS:
                    place = {phase: float(n) for n, phase in enumerate(phases, 1)}
                    values = np.array([place[phase] for phase in values.tolist()])
                record[_field_name(name)] = values.astype(np.float64)[:, None]
        scipy.io.savemat(out, {'runs': runs})

    def _parquet(self, out: BinaryIO) -> None:
        import pandas
        import pyarrow  # noqa: F401  # pandas says only that no engine is usable
        frames = [pandas.DataFrame({'run': run.name, **columns}) for run, columns in self._tables()]
        pandas.concat(frames, ignore_index=True).to_parquet(out, index=False)


def _without_nan(values: np.ndarray) -> list[Any]:
    return [value if isinstance(value, str) or math.isfinite(value) else None for value in values.tolist()]


def _ascii(text: str) -> str:
    return text.encode('ascii', 'replace').decode()


def _field_name(name: str) -> str:
    """A valid name of a field in Octave and MATLAB."""
    name = re.sub(r'[^A-Za-z0-9_]', '_', name)[:_FIELD_CHARACTERS]
    return name if re.match(r'[A-Za-z]', name) else ('x' + name)[:_FIELD_CHARACTERS]
