"""The results of a study: a row for each run, quantiles, maps, and Sobol's sensitivity indices."""
import gzip
import json
import os
import pathlib
import zlib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas

from ..core import _core
from ..files import parse_json, write_whole
from ..places import how_to_install

#: what pip is asked for
SALIB, PYARROW = '"SALib<1.5"', '"pyarrow<24"'
RESULTS = 'results.csv.gz'
#: a header with the study's text and configurations is longer than any buffer of a reader
_HEADER_BYTES = 1 << 24
#: columns of texts that few values fill
_FEW = ('plant', 'experiment', 'controller', 'result')


class StudyResults:
    """Results of a study, read from its folder or from results.csv.gz alone.

    facts:   dictionary: study (its name), text, identity (SHA-256 of all that the results depend on), program, runs, ...
    factors: names of the factors' columns; `ranges` are those whose values a design spreads, `levels` the others.
    metrics: names of the metrics' columns, those of a run's summary.

    A column is read from the file when it is first wanted, and kept: 8 bytes a row.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        place = pathlib.Path(path)
        self.path = place / RESULTS if place.is_dir() else place
        if not self.path.is_file():
            done = len(list((place / 'parts').glob('[0-9]*.csv.gz')))
            hint = (f'; the study is not complete: {done} of its chunks are done. The same command goes on where it was '
                    'interrupted; `abs_hil study status` names what is missing'
                    if (place / 'study.json').exists() else '; give the folder of a study, or its results.csv.gz')
            raise ValueError(f'{self.path}: no results{hint}')
        if place.is_dir():
            _core.check_seal(os.fsencode(place))
        with open(self.path, 'rb') as file:
            head = file.read(_HEADER_BYTES)
        try:
            self.facts: dict[str, Any] = parse_json(_core.facts_of_results(head))
            self.ranges: list[str] = self.facts['ranges']
            self.levels: list[str] = self.facts['levels']
            self.metrics: list[str] = self.facts['metrics']
            self.factors = [name for name in self.facts['columns'] if name in (*self.ranges, *self.levels)]
        except (RuntimeError, ValueError, KeyError) as error:
            raise ValueError(f'{self.path}: not the results of a study: {error}') from None
        self._columns: dict[str, Any] = {}  # arrays of numpy or pandas; a Series would keep an index of 8 bytes a row
        self._data: pandas.DataFrame | None = None

    def __len__(self) -> int:
        return int(self.facts['runs'])

    def __repr__(self) -> str:
        return f'<abs_hil.StudyResults {self.facts["study"]}: {len(self)} runs>'

    def chunks(self, columns: Sequence[str] | None = None, rows: int = 100_000) -> Iterator[pandas.DataFrame]:
        """The rows as an iterator of DataFrames of at most `rows` rows: for studies that do not fit into the memory."""
        try:
            with gzip.open(self.path, 'rb') as file:
                yield from pandas.read_csv(file, usecols=None if columns is None else list(columns), chunksize=rows,
                                           dtype={**{name: 'category' for name in _FEW}, 'reason': 'string'},
                                           keep_default_na=False, float_precision='round_trip',
                                           na_values={name: ['nan'] for name in [*self.factors, *self.metrics]})
        except (pandas.errors.ParserError, EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(f'{self.path}: the rows are cut or damaged ({str(error).splitlines()[0]}); run or merge the study '
                             'again') from None

    def columns(self, names: Sequence[str]) -> pandas.DataFrame:
        """Some columns of all rows, each once, one row a run, in order. Metrics of a run that has none are NaN."""
        names = list(dict.fromkeys(names))
        if self._data is not None:
            return self._data[names]
        if missing := [name for name in names if name not in self._columns]:
            self._columns.update(self._read(missing))
        return pandas.DataFrame({name: self._columns[name] for name in names}, copy=False)

    def _read(self, names: list[str]) -> dict[str, Any]:
        """Columns of all rows. Numbers are copied to their place piece by piece, so that nothing is in memory twice."""
        numbers: dict[str, np.ndarray] = {}
        texts: dict[str, list[pandas.Series]] = {}
        row = 0
        for frame in self.chunks(names, rows=10_000):  # the parser takes some 1,000 bytes a row
            if row + len(frame) > len(self):
                raise ValueError(f'{self.path}: more than the {len(self)} rows of its runs')
            for name, piece in frame.items():
                if not pandas.api.types.is_numeric_dtype(piece.dtype):
                    texts.setdefault(name, []).append(piece.copy())
                    continue
                whole = numbers.get(name, np.empty(len(self) if row == 0 else 0, piece.dtype))
                if piece.dtype != whole.dtype:  # whole numbers first, others later
                    whole = whole.astype(np.result_type(piece.dtype, whole.dtype))
                whole[row:row + len(frame)] = piece
                numbers[name] = whole
            row += len(frame)
        if row != len(self):
            raise ValueError(f'{self.path}: {row} rows instead of the {len(self)} of its runs')
        found: dict[str, Any] = dict(numbers)
        for name, pieces in texts.items():
            text = pandas.concat(pieces, ignore_index=True)
            found[name] = (text.astype('category') if name in _FEW else text).array
        return found

    @property
    def data(self) -> pandas.DataFrame:
        """All columns of all rows as a pandas DataFrame, the same one each time."""
        if self._data is None:
            self._data = self.columns(self.facts['columns'])
            self._columns.clear()
        return self._data

    def completed(self, names: Sequence[str]) -> pandas.DataFrame:
        """Some columns of the runs that no fault ended and that could begin."""
        rows = self.columns(names)
        complete = self.columns(['result'])['result'] == 'completed'
        return rows if complete.all() else rows[complete]

    @property
    def groups(self) -> list[str]:
        """Columns of what has few values and more than one: plant, experiment, controller, factors with levels."""
        names = ['plant', 'experiment', 'controller', *self.levels]
        return [name for name, different in self.columns(names).nunique().items() if different > 1]

    def quantiles(self, by: str | Sequence[str] | None = None, metrics: Sequence[str] | None = None,
                  q: Sequence[float] = (0.1, 0.5, 0.9)) -> pandas.DataFrame:
        """Quantiles of metrics over the completed runs of each group: index (group, metric), columns `runs` (those that
        have the metric) and the quantiles. by: columns; default: `groups`."""
        by = self.groups if by is None else [by] if isinstance(by, str) else list(by)
        wanted = [name for name in self.metrics if metrics is None or name in metrics]
        kept = dict(self._columns)
        self.columns([*by, *wanted])  # in one reading
        found: dict[tuple[Any, ...], dict[str, list[float]]] = {}
        for metric in wanted:
            frame = self.completed([*by, metric])
            parts = frame.groupby(by if len(by) > 1 else by[0], observed=True)[metric] if by else [((), frame[metric])]
            for group, part in parts:
                values = part.dropna()
                numbers = values.quantile(list(q)) if len(values) else [np.nan] * len(q)
                found.setdefault(group if isinstance(group, tuple) else (group,), {})[metric] = [len(values), *numbers]
        self._columns = kept  # all metrics of many runs are more than a map or the next quantiles need
        return pandas.DataFrame(
            [row for of_group in found.values() for row in of_group.values()], columns=['runs', *q],
            index=pandas.MultiIndex.from_tuples([(*group, metric) for group, of_group in found.items() for metric in of_group],
                                                names=[*by, 'metric']))

    def map(self, x: str, y: str, metric: str, bins: int = 12, where: dict[str, Any] | None = None) -> pandas.DataFrame:
        """Medians of a metric over two columns: rows y, columns x. A column of more than `bins` values is cut into `bins`
        equal parts, each under its middle. where: values of other columns, as {"controller": "adaptive"}."""
        rows = self.completed([x, y, metric, *(where or {})])
        for name, value in (where or {}).items():
            rows = rows[rows[name] == value]
        return rows.groupby([_binned(rows[y], bins), _binned(rows[x], bins)])[metric].median().unstack()

    def sobol_indices(self, metric: str, where: dict[str, Any] | None = None, seed: int = 1) -> pandas.DataFrame:
        """Sobol's sensitivity indices of a metric by SALib: columns S1 (first order), ST (total) and the half widths of
        their 95 % intervals; index: factors with ranges. For the design `saltelli` alone. Raises ValueError for another
        design, for runs that lack the metric, and if `where` leaves several groups."""
        if self.facts['design'] != 'saltelli':
            raise ValueError(f'design {self.facts["design"]}: Sobol indices need the design saltelli')
        try:
            from SALib.analyze import sobol
        except ImportError:
            raise ImportError(f"Sobol indices need SALib; install it: {how_to_install(SALIB)}") from None
        rows = self.columns(['point', 'plant', 'experiment', 'controller', *self.levels, *(where or {}), metric])
        for name, value in (where or {}).items():
            rows = rows[rows[name] == value]
        if others := [name for name in ('plant', 'experiment', 'controller', *self.levels) if rows[name].nunique() > 1]:
            raise ValueError(f'where: give values of {", ".join(others)}')
        values = rows.groupby('point', sort=True)[metric].mean().to_numpy()  # over the repetitions
        if not np.isfinite(values).all():
            raise ValueError(f'{metric}: {np.count_nonzero(~np.isfinite(values))} of {len(values)} points have none; Sobol '
                             'indices need all')
        problem = {'num_vars': len(self.ranges), 'names': self.ranges, 'bounds': [[0.0, 1.0]] * len(self.ranges)}
        found = sobol.analyze(problem, values, calc_second_order=False, seed=seed)
        return pandas.DataFrame({name: found[name] for name in ('S1', 'S1_conf', 'ST', 'ST_conf')}, index=self.ranges)

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Writes all rows to a Parquet file, with the facts under the key `abs_hil.study` of its metadata. Needs pyarrow."""
        write_whole(path, self._write_parquet)

    def _write_parquet(self, path: str) -> None:
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            raise ImportError(f"Parquet needs pyarrow; install it: {how_to_install(PYARROW)}") from None
        writer = None
        try:
            for frame in self.chunks():
                for name in _FEW:
                    frame[name] = frame[name].astype(str)
                table = pyarrow.Table.from_pandas(frame, preserve_index=False)
                if writer is None:
                    kept = {**(table.schema.metadata or {}), b'abs_hil.study': json.dumps(self.facts).encode()}
                    writer = parquet.ParquetWriter(path, table.schema.with_metadata(kept), compression='zstd')
                writer.write_table(table.cast(writer.schema))
        finally:
            if writer is not None:
                writer.close()


def _binned(values: pandas.Series, bins: int) -> pandas.Series:
    """The values, or the middles of the parts that they lie in if there are many."""
    if not np.issubdtype(values.dtype, np.number):
        return values
    # Some rows tell of most columns that the values are many; counting all of them takes 40 bytes a row.
    if values.iloc[:10_000].nunique() <= bins and values.nunique() <= bins:
        return values
    edges = np.linspace(values.min(), values.max(), bins + 1)
    part = np.searchsorted(edges, values, side='right')
    part -= 1
    np.clip(part, 0, bins - 1, out=part)
    return pandas.Series((0.5 * (edges[:-1] + edges[1:]))[part], index=values.index, name=values.name)


def load_study(path: str | os.PathLike[str]) -> StudyResults:
    """The results of a study: its folder, or results.csv.gz. Raises ValueError for anything else."""
    return StudyResults(path)
