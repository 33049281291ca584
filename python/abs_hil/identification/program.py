"""The command line of abs_identify, and how far it is: lines for each stage, and on a terminal the time that passed."""
import argparse
import contextlib
import json
import math
import pathlib
import sys
import time
from typing import Any, TextIO

from .. import parsers
from ..files import make_folder, refuse_existing, write_text, write_whole
from ..options import failed
from ..places import Unavailable, misfit
from ..report.page import plotly_js
from ..report.text import clean
from .estimate import identify
from .results import as_json, as_toml, speeds_as_json, speeds_as_toml, validate, validating, words
from .speeds import identify_speeds
from .traces import load_trace

MISFIT = 1
INTERRUPTED = 130
DRAW_S = 0.2


class Progress:
    """`say` takes what abs_hil.identify says, `check` is called often."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._terminal = self._stream.isatty()
        self._begin, self._drawn = time.monotonic(), 0.0

    def say(self, text: str) -> None:
        self.clear()
        print(f'abs_identify: {text}', file=self._stream, flush=True)
        self.check()

    def check(self) -> None:
        now = time.monotonic()
        if not self._terminal or now - self._drawn < DRAW_S:
            return
        self._drawn = now
        passed_s = now - self._begin
        self._stream.write('\r\x1b[K' + (f'{passed_s:.0f} s' if passed_s < 90.0 else f'{passed_s / 60.0:.0f} min'))
        self._stream.flush()

    def end(self) -> None:
        """Nothing more takes time."""
        self.clear()
        self._terminal = False

    def clear(self) -> None:
        if self._terminal and self._drawn:
            self._stream.write('\r\x1b[K')
            self._stream.flush()
        self._drawn = 0.0


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
    if not model:
        (out / 'model.toml').unlink(missing_ok=True)  # of an earlier fit: these logs do not bear it out
    identified = json.dumps(content, indent=1, allow_nan=False) + '\n'
    for name, text in (('identified.json', identified), ('model.toml', model), ('report.html', report)):
        if text:
            write_text(out / name, text)
            print(out / name)


def _speeds(o: argparse.Namespace, fixed: dict[str, float | None], progress: Progress) -> int:
    told: list[tuple[str, dict[str, float]]] = [('', {})]  # first what holds for all files
    for one in o.speeds:
        if isinstance(one, str):
            told.append((one, dict(told[0][1])))
        else:
            told[-1][1].update([one])
    try:
        found = identify_speeds([load_trace(file, keys) for file, keys in told[1:]], o.start, fix=fixed, say=progress.say,
                                check=progress.check)
    finally:
        progress.end()
    if not found.misfit:
        print('\n'.join(words(found.parameters)), flush=True)
    for line in (*(f'{name}: {kind} fitted within {rms:.3g} {unit} RMS' for name, kind, rms, unit in found.left), *found.notes,
                 *([found.misfit] if found.misfit else [])):
        progress.say(clean(line, 2000))
    _write(o.out, speeds_as_json(found), '' if found.misfit else speeds_as_toml(found), None)
    return MISFIT if found.misfit else 0


def _identify(o: argparse.Namespace) -> int:
    fixed = _fixed(o.fix)
    traces = any(isinstance(one, str) for one in o.speeds)
    if o.speeds and not traces:
        raise ValueError('--reading goes with --speeds FILE')
    if bool(o.logs) == traces:
        raise ValueError('give logs, or coarse traces with --speeds FILE' + (', not both' if traces else ''))
    if traces and (o.validate or o.drift or o.form != 'auto'):
        raise ValueError('--validate, --drift and --form go with logs of counts, not with --speeds')
    run = validating(o.validate) if o.validate else None
    make_folder(o.out, '--out')
    for name in ('identified.json', 'model.toml', 'report.html'):
        refuse_existing(o.out / name, '--out', o.force)
        write_whole(o.out / name, lambda _: None, probe=True)
    if not o.no_report:
        plotly_js()  # what the page needs, before the work rather than behind it

    progress = Progress()
    say = progress.say
    if traces:
        return _speeds(o, fixed, progress)
    try:
        found = identify(o.logs, o.start, fix=fixed, drift=o.drift, form=o.form, seed=o.seed, say=say, check=progress.check)
    finally:
        progress.clear()
    if run is not None and not (found.interrupted or found.misfit):
        found.validation = validate(found, run)
        measured, predicted = (found.validation[name] or math.nan for name in ('stop_distance_m', 'predicted_stop_distance_m'))
        say(f'{o.validate}: stop distance {measured:.5g} m, predicted {predicted:.5g} m')
        if found.validation['misfit']:
            found.misfit = f'{found.validation["misfit"]}. So no model.toml is written'
            found.notes.insert(0, found.misfit)
    report = None
    if not o.no_report and not found.interrupted:
        from .advice import advise
        from .page import page
        say('what to run next')
        report = page(found, [] if found.misfit else advise(found))
    progress.end()
    if not found.refused:
        print('\n'.join(words({**found.parameters, **found.combinations})), flush=True)
    for note in found.notes:
        say(clean(note, 2000))
    _write(o.out, as_json(found), '' if found.misfit or found.interrupted else as_toml(found), report)
    return INTERRUPTED if found.interrupted else MISFIT if found.misfit else 0


def main(arguments: list[str]) -> int:
    o = parsers.identify().parse_args(arguments)
    made = [folder for folder in (o.out, *o.out.parents) if not folder.exists()]
    try:
        return _identify(o)
    except Unavailable as error:
        return failed('abs_identify', f'{error}; --no-report leaves the page out', 3)
    except (ValueError, OSError) as error:
        return failed('abs_identify', error if misfit(error) else clean(error, 4000))
    except KeyboardInterrupt:
        return failed('abs_identify', 'interrupted; nothing is written', INTERRUPTED)
    finally:
        for folder in made:
            with contextlib.suppress(OSError):  # it holds results
                folder.rmdir()
