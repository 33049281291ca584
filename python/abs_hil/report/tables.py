"""The tables of a report. Cells are plain text."""
import dataclasses
import math
from dataclasses import dataclass
from typing import Self

import pandas

from ..run import Event
from .files import RunFiles, differing_keys
from .survey import Survey, contradictions, merits_shown, value_of
from .text import DASH, shown, significant

#: with more runs than this, runs become rows instead of columns
MOST_COLUMNS = 5
MOST_EVENTS = 200


@dataclass
class Table:
    id: str
    header: list[str]
    rows: list[list[str]]
    numbers: bool = True  # the first column names the row; all others are numbers, aligned to the right

    def arranged(self, runs: int) -> Self:
        """With many runs, rows and columns change places."""
        if runs <= MOST_COLUMNS:
            return self
        lines = [list(line) for line in zip(*[self.header, *self.rows])]
        return dataclasses.replace(self, header=lines[0], rows=lines[1:])


def _change(first: float, second: float) -> str:
    """Change from the first to the second run, in per cent; a large change as a factor."""
    large = 3.0
    if not (math.isfinite(first) and math.isfinite(second)) or first == 0.0:
        return DASH
    if second / first >= large:
        return f'× {significant(second / first, 3)}'
    return f'{"+" if second > first else ""}{shown(100.0 * (second / first - 1.0), 1)} %'


def _model_note(run: RunFiles) -> str:
    """Where the controllers' model differs from the simulated plant."""
    names = sorted(key.removeprefix('model.') for key in run.config if key.startswith('model.'))
    beliefs = [(name, run.config[f'model.{name}'], run.config.get(f'plant.{name}')) for name in names]
    return ', '.join(f'{name} {value} (plant {plant})' for name, value, plant in beliefs if plant not in (None, value))


def metrics_table(runs: list[RunFiles], surveys: list[Survey]) -> tuple[Table, str]:
    """The figures of merit, and what all of many runs share as one sentence."""
    header = ['', *(run.label for run in runs), *['second relative to first'] * (len(runs) == 2)]
    rows: dict[str, list[str]] = {}
    shared = []
    for key in ('result', 'reason', 'experiment', 'controller', 'plant', 'backend'):
        cells = [run.text(key) or DASH for run in runs]
        if all(cell == DASH for cell in cells):
            continue
        if len(runs) > MOST_COLUMNS and len(set(cells)) == 1:
            shared.append(f'{key}: {cells[0]}')
        else:
            rows[key] = cells
    models = [_model_note(run) for run in runs]
    if any(models):
        rows['model differs from plant'] = [model or DASH for model in models]
    rows['speeds and slip'] = ['truth' if 'omega2_rad_s' in found.known else 'estimates' for found in surveys]
    for metric in merits_shown():
        values = [value_of(metric, run, found) for run, found in zip(runs, surveys)]
        if any(math.isfinite(value) for value in values):
            changes = [_change(*values)] if len(runs) == 2 and metric.better == 'less' else []
            rows[metric.heading] = [shown(value, metric.decimals) for value in values] + changes
    rows['rows in the CSV'] = [str(found.rows) for found in surveys]
    rows['run'] = [run.name for run in runs]
    lines = [[name, *cells, *[''] * (len(header) - 1 - len(cells))] for name, cells in rows.items()]
    return Table('metrics', header, lines).arranged(len(runs)), f'All runs: {"; ".join(shared)}.' if shared else ''


def phases_table(runs: list[RunFiles], surveys: list[Survey]) -> Table:
    """One row a phase of braking of each run that has several, one column a figure of merit."""
    several = [(run, name, values) for run, found in zip(runs, surveys) for name, values in found.brakings]
    metrics = [metric for metric in merits_shown() if any(math.isfinite(values[metric.name]) for _, _, values in several)]
    return Table('phases', ['phase', *(['of'] if len(runs) > 1 else []), *(metric.heading for metric in metrics)],
                 [[name, *([run.label] if len(runs) > 1 else []),
                   *(shown(values[metric.name], metric.decimals) for metric in metrics)] for run, name, values in several])


def merits(runs: list[RunFiles], surveys: list[Survey]) -> pandas.DataFrame:
    """The figures of merit with full precision, one row a run."""
    return pandas.DataFrame([
        {'run': run.called, **{key: run.text(key) for key in ('controller', 'plant', 'experiment', 'result')},
         **{metric.name: value_of(metric, run, found) for metric in merits_shown()}} for run, found in zip(runs, surveys)])


def timing_table(runs: list[RunFiles]) -> Table:
    timed = [run for run in runs if math.isfinite(run.number('cycle_time_us.p50'))]
    numbers = {f'{part}, {name}': f'{key}.{quantile}'
               for key, part in (('wakeup_latency_us', 'wake-up latency'), ('read_us', 'read'), ('control_us', 'control'),
                                 ('write_us', 'write'), ('cycle_time_us', 'whole cycle'))
               for quantile, name in (('p50', 'median'), ('p99', '99 %'), ('p99_9', '99.9 %'), ('max', 'greatest'))}
    numbers |= {'cycles': 'cycles', 'late cycles': 'overruns', 'late at start-up': 'overruns_startup',
                'longest run of late cycles': 'overruns_longest_run', 'ticks missed': 'ticks_missed',
                'records lost': 'telemetry_drops'}
    rows = [[name, *(shown(run.number(key), 0) for run in timed)] for name, key in numbers.items()]
    rows += [['verdict on the wheels overdue, % of the time', *(shown(100.0 * run.number('checks_unjudged'), 1) for run in timed)],
             ['real time obtained', *('yes' if run.summary.get('realtime') is True else 'no' for run in timed)]]
    return Table('timing', ['µs', *(run.label for run in timed)], rows if timed else []).arranged(len(timed))


def differences_table(runs: list[RunFiles]) -> Table:
    return Table('differences', ['key', *(run.label for run in runs)],
                 [[key, *(run.config.get(key, DASH) for run in runs)] for key in differing_keys(runs)],
                 False).arranged(len(runs))


def environment_table(runs: list[RunFiles]) -> Table:
    keys = sorted({key for run in runs for key in run.environment})
    return Table('environment', ['', *(run.label for run in runs)],
                 [[key, *(run.environment.get(key, DASH) for run in runs)] for key in keys], False).arranged(len(runs))


def _events_of(run: RunFiles, found: Survey) -> list[Event]:
    """The events; changes of phase for a run folder without them."""
    if run.events:
        return run.events
    events = [Event(p.from_s, 'fault' if p.phase == 'fault' else 'phase', p.phase, name=p.name) for p in found.phases]
    if events and events[-1].event == 'fault':
        events[-1].reason = run.text('reason')
    return events


def events_table(runs: list[RunFiles], surveys: list[Survey]) -> tuple[Table, int]:
    """The events of all runs, and how many more there are. A phase with a name of its own is "brake-low (brake)"."""
    rows = [[shown(event.time_s, 3), run.label, event.event,
             event.phase if event.name in ('', event.phase) else f'{event.name} ({event.phase})', event.reason, event.value]
            for run, found in zip(runs, surveys) for event in _events_of(run, found)]
    return (Table('events', ['time / s', 'run', 'event', 'phase', 'reason', 'value'], rows[:MOST_EVENTS], False),
            max(0, len(rows) - MOST_EVENTS))


def all_notes(runs: list[RunFiles], surveys: list[Survey], general: list[str]) -> list[str]:
    """The general notes, then notes about missing or unusual data of each run."""
    notes = list(general)
    for run, found in zip(runs, surveys):
        cut = ['the last row of the CSV is incomplete, as after a crash, and is left out'] * found.truncated
        notes += [f'{run.called}: {note}' for note in [*run.notes, *cut, *contradictions(run, found)]]
    return notes
