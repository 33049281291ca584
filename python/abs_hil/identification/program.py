"""The command line of abs_identify, and how far it is: lines for each stage, and on a terminal one changing line with the time
left."""
import argparse
import contextlib
import json
import pathlib
import sys
import time
from typing import Any, TextIO

from ..core import _core
from ..files import make_folder, refuse_existing, write_text, write_whole
from ..options import failed, whole
from ..report.page import Unavailable, plotly_js
from ..report.text import clean
from .estimate import identify
from .parameters import FORMS
from .results import as_json, as_toml, speeds_as_json, speeds_as_toml, validate, validating, words
from .speeds import identify_speeds
from .traces import KEYS, checked_key, load_trace

MISFIT = 1
INTERRUPTED = 130
#: words by which a stage's line is known -> what this stage and all after it take, over the time of the first form's first
#: values. Measured on five logs of the series, of rigs with and without disturbances; the larger one of the two.
LEFT = (('first values', 4.6), ('left-out logs', 3.8), ('fit', 3.8), ('the rig wanders', 3.1), ('disturbances', 1.8),
        ('intervals', 0.4), ('what to run next', 0.3))
DRAW_S = 0.2


class Progress:
    """`say` takes what abs_hil.identify says, `check` is called often."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._begin = self._stage_begin = time.monotonic()
        self._drawn = 0.0
        self._stage = 'logs'
        self._stages = 0
        self._unit_s: float | None = None

    def say(self, text: str) -> None:
        now = time.monotonic()
        self.clear()
        print(f'abs_identify: {text}', file=self._stream, flush=True)
        self._stages += 1
        if self._stages == 2:
            self._unit_s = now - self._stage_begin
        self._stage, self._stage_begin = text, now
        self.check()

    def check(self) -> None:
        now = time.monotonic()
        if not self._terminal or now - self._drawn < DRAW_S:
            return
        self._drawn = now
        left_s = self.left_s(now)
        left = f', about {duration(left_s)} left' if left_s > 0.0 else ''
        self._stream.write(f'\r\x1b[K{duration(now - self._begin)}{left}')
        self._stream.flush()

    def end(self) -> None:
        """Nothing more takes time."""
        self.clear()
        self._terminal = False

    def left_s(self, now: float) -> float:
        """0: not known, or the stage has taken longer than it should have."""
        share = next((share for words, share in LEFT if words in self._stage), 0.0)
        return 0.0 if self._unit_s is None else max(0.0, share * self._unit_s - (now - self._stage_begin))

    def clear(self) -> None:
        if self._terminal and self._drawn:
            self._stream.write('\r\x1b[K')
            self._stream.flush()
        self._drawn = 0.0


def duration(seconds: float) -> str:
    return f'{seconds:.0f} s' if seconds < 90.0 else f'{seconds / 60.0:.0f} min'


class _Speeds(argparse.Action):
    """Keeps each file with its keys."""
    def __call__(self, parser: argparse.ArgumentParser, o: argparse.Namespace, value: Any, option: str | None = None) -> None:
        o.speeds = [*o.speeds, (value, {})]


class _Reading(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, o: argparse.Namespace, value: Any, option: str | None = None) -> None:
        try:
            key, number = checked_key(value)
        except ValueError as error:
            parser.error(str(error))
        if o.speeds:
            o.speeds[-1][1][key] = number
        else:
            o.reading = {**o.reading, key: number}


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser('abs_identify', allow_abbrev=False, description="Estimates the rig's parameters from its own "
                                   'logs and writes a model file (docs/identification.md)')
    made.add_argument('logs', metavar='LOG', nargs='*', help='run folders, event logs, or CSV files with time_s, upper_counts, '
                      'lower_counts, brake_pwm, motor_pwm and, if there, phase and wheels_apart; gzip or not')
    made.add_argument('--speeds', metavar='FILE', action=_Speeds, default=[],
                      help='instead of logs, a CSV file of coarse wheel speeds: time_s and some of upper_rpm, lower_rpm (also '
                      '_rad_s, _m_s), slip, brake_pwm, motor_pwm; may be repeated')
    made.add_argument('--reading', metavar='KEY=VALUE', action=_Reading, default={},
                      help='how the --speeds FILE before it was read, or, before the first one, all of them: '
                      + '; '.join(f'{key}: {one.what}' for key, one in KEYS.items()).replace('%', '%%'))
    made.add_argument('--start', metavar='NAME|FILE', default='paper-table1',
                      help='plant with the given J2 and r2, and what the logs do not tell [paper-table1]')
    made.add_argument('--fix', metavar='KEY[=VALUE]', action='append', default=[],
                      help="leave a parameter at its start's value, or at this one: J2_kg_m2=0.0266")
    made.add_argument('--drift', metavar='KEY', action='append', default=[],
                      help='a factor that may differ from log to log: brake_torque')
    made.add_argument('--form', choices=('auto', *FORMS), default='auto',
                      help='form of the plant; auto takes the one that better predicts left-out logs [auto]')
    made.add_argument('--validate', metavar='FOLDER', help='run folder, not among the logs, whose stop is predicted')
    made.add_argument('--out', metavar='DIR', type=pathlib.Path, default=pathlib.Path('identified'),
                      help='folder for model.toml, identified.json and report.html [identified]')
    made.add_argument('--force', action='store_true', help='replace existing files')
    made.add_argument('--seed', metavar='N', type=whole(0, 2**63 - 1), default=1, help='seed of the bootstrap [1]')
    made.add_argument('--no-report', action='store_true', help='write no page, and advise nothing')
    made.add_argument('--version', action='version', version=_core.version)
    return made


def _fixed(texts: list[str]) -> dict[str, float | None]:
    fixed: dict[str, float | None] = {}
    for text in texts:
        key, equals, number = text.partition('=')
        try:
            fixed[key] = float(number) if equals else None
        except ValueError:
            raise ValueError(f'--fix {text}: "{number}" is no number') from None
    return fixed


def _write(out: pathlib.Path, content: dict[str, Any], model: str, report: str | None) -> None:
    """identified.json, model.toml unless it is empty, and the page."""
    files = {'identified.json': json.dumps(content, indent=1, allow_nan=False) + '\n'}
    if model:
        files['model.toml'] = model
    else:
        (out / 'model.toml').unlink(missing_ok=True)  # of an earlier fit: these logs do not bear it out
    if report is not None:
        files['report.html'] = report
    for name, text in files.items():
        path = out / name
        write_text(path, text)
        print(path)


def _speeds(o: argparse.Namespace, fixed: dict[str, float | None], progress: Progress) -> int:
    traces = [load_trace(file, {**o.reading, **keys}) for file, keys in o.speeds]
    try:
        found = identify_speeds(traces, o.start, fix=fixed, say=progress.say, check=progress.check)
    finally:
        progress.clear()
    from .page import speeds_page
    report = None if o.no_report else speeds_page(found)
    progress.end()
    if not found.misfit:
        print('\n'.join(words(found.parameters)), flush=True)
    for line in (*(f'{name}: {kind} fitted within {rms:.3g} {unit} RMS' for name, kind, rms, unit in found.left), *found.notes,
                 *([found.misfit] if found.misfit else [])):
        progress.say(clean(line, 2000))
    _write(o.out, speeds_as_json(found), '' if found.misfit else speeds_as_toml(found), report)
    return MISFIT if found.misfit else 0


def _identify(o: argparse.Namespace) -> int:
    fixed = _fixed(o.fix)
    if bool(o.logs) == bool(o.speeds):
        raise ValueError('give logs, or coarse traces with --speeds FILE' + (', not both' if o.logs else ''))
    if o.speeds and (o.validate or o.drift or o.form != 'auto'):
        raise ValueError('--validate, --drift and --form go with logs of counts, not with --speeds')
    if o.reading and not o.speeds:
        raise ValueError('--reading goes with --speeds FILE')
    run = validating(o.validate) if o.validate else None
    make_folder(o.out, '--out')
    for name in ('identified.json', 'model.toml', 'report.html'):
        refuse_existing(o.out / name, '--out', o.force)
        write_whole(o.out / name, lambda _: None, probe=True)
    if not o.no_report:
        plotly_js()  # what the page needs, before the work rather than behind it

    progress = Progress()
    say = progress.say
    if o.speeds:
        return _speeds(o, fixed, progress)
    try:
        found = identify(o.logs, o.start, fix=fixed, drift=o.drift, form=o.form, seed=o.seed, say=say, check=progress.check)
    finally:
        progress.clear()
    if run is not None and not (found.interrupted or found.misfit):
        found.validation = validate(found, run)
        say(f'{o.validate}: stop distance {found.validation["stop_distance_m"]:.5g} m, predicted '
            f'{found.validation["predicted_stop_distance_m"]:.5g} m')
        if found.validation['misfit']:
            found.misfit = f'{found.validation["misfit"]}. So no model.toml is written'
            found.notes.insert(0, found.misfit)
    report = None
    if not o.no_report and not found.interrupted:
        from .advice import advise
        from .page import page
        say('what to run next')
        report = page(found, [] if found.misfit else advise(found, progress.check))
    progress.end()
    if not found.refused:
        print('\n'.join(words({**found.parameters, **found.combinations})), flush=True)
    for note in found.notes:
        say(clean(note, 2000))
    _write(o.out, as_json(found), '' if found.misfit or found.interrupted else as_toml(found), report)
    return INTERRUPTED if found.interrupted else MISFIT if found.misfit else 0


def main(arguments: list[str]) -> int:
    o = parser().parse_args(arguments)
    made = [folder for folder in (o.out, *o.out.parents) if not folder.exists()]
    try:
        return _identify(o)
    except Unavailable as error:
        return failed('abs_identify', f'{error}; --no-report leaves the page out', 3)
    except (ValueError, OSError) as error:
        return failed('abs_identify', clean(error, 4000))
    except KeyboardInterrupt:
        return failed('abs_identify', 'interrupted; nothing is written', INTERRUPTED)
    finally:
        for folder in made:
            with contextlib.suppress(OSError):  # it holds results
                folder.rmdir()
