"""The command line of abs_identify, and how far it is: lines for each stage, and on a terminal one changing line with the time
left."""
import argparse
import contextlib
import json
import sys
import time
from typing import TextIO

from .. import parsers
from ..files import make_folder, refuse_existing, write_text, write_whole
from ..options import failed
from ..places import Unavailable, misfit
from ..report.page import plotly_js
from ..report.text import clean
from .estimate import identify
from .found import Identified
from .results import as_json, as_toml, validate, validating, words

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


def _fixed(texts: list[str]) -> dict[str, float | None]:
    fixed: dict[str, float | None] = {}
    for text in texts:
        key, equals, number = text.partition('=')
        try:
            fixed[key] = float(number) if equals else None
        except ValueError:
            raise ValueError(f'--fix {text}: "{number}" is no number') from None
    return fixed


def _write(found: Identified, o: argparse.Namespace, report: str | None) -> None:
    files = {'identified.json': json.dumps(as_json(found), indent=1, allow_nan=False) + '\n'}
    if not (found.misfit or found.interrupted):
        files['model.toml'] = as_toml(found)
    else:
        (o.out / 'model.toml').unlink(missing_ok=True)  # of an earlier fit: these logs do not bear it out
    if report is not None:
        files['report.html'] = report
    for name, text in files.items():
        path = o.out / name
        write_text(path, text)
        print(path)


def _identify(o: argparse.Namespace) -> int:
    fixed = _fixed(o.fix)
    run = validating(o.validate) if o.validate else None
    make_folder(o.out, '--out')
    for name in ('identified.json', 'model.toml', 'report.html'):
        refuse_existing(o.out / name, '--out', o.force)
        write_whole(o.out / name, lambda _: None, probe=True)
    if not o.no_report:
        plotly_js()  # what the page needs, before the work rather than behind it

    progress = Progress()
    say = progress.say
    try:
        found = identify(o.logs, o.start, fix=fixed, drift=o.drift, form=o.form, seed=o.seed, say=say, check=progress.check)
    finally:
        progress.clear()
    if run is not None and not (found.interrupted or found.misfit):
        found.validation = validate(found, run)
        say(f'{o.validate}: stop distance {found.validation["stop_distance_m"]:.5g} m, predicted '
            f'{found.validation["predicted_stop_distance_m"]:.5g} m')
    report = None
    if not o.no_report and not found.interrupted:
        from .advice import advise
        from .page import page
        say('what to run next')
        report = page(found, [] if found.misfit else advise(found, progress.check))
    progress.end()
    print('\n'.join(words(found)), flush=True)
    for note in found.notes:
        say(clean(note, 2000))
    _write(found, o, report)
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
