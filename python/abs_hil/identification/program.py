"""The command line of abs_identify."""
import argparse
import json
import pathlib
import sys

from ..core import _core
from ..files import write_text
from ..report.page import Unavailable, plotly_js
from ..report.text import clean
from .estimate import identify
from .found import Identified
from .parameters import FORMS
from .progress import Progress
from .results import as_json, as_toml, validate, words

MISFIT = 1
INTERRUPTED = 130


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser('abs_identify', allow_abbrev=False, description="Estimates the rig's parameters from its own "
                                   'logs and writes a model file (docs/identification.md)')
    made.add_argument('logs', metavar='LOG', nargs='+', help='run folders, event logs, or CSV files with time_s, upper_counts, '
                      'lower_counts, brake_pwm, motor_pwm and, if there, phase and wheels_apart; gzip or not')
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
    made.add_argument('--seed', metavar='N', type=int, default=1, help='seed of the bootstrap [1]')
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
    o.out.mkdir(parents=True, exist_ok=True)
    for name in ('identified.json', 'model.toml', 'report.html'):
        if (o.out / name).exists() and not o.force:
            raise ValueError(f'"{o.out / name}" exists; give another --out, or --force to replace it')
    if not o.no_report:
        plotly_js()  # what the page needs, before the work rather than behind it

    progress = Progress()
    say = progress.say
    try:
        found = identify(o.logs, o.start, fix=fixed, drift=o.drift, form=o.form, seed=o.seed, say=say, check=progress.check)
    finally:
        progress.clear()
    if o.validate and not (found.interrupted or found.misfit):
        found.validation = validate(found, o.validate)
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
    o = parser().parse_args(arguments)
    try:
        return _identify(o)
    except Unavailable as error:
        print(f'abs_identify: {error}; --no-report leaves the page out', file=sys.stderr)
        return 3
    except (ValueError, OSError) as error:
        print(f'abs_identify: {clean(error, 4000)}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print('abs_identify: interrupted; nothing is written', file=sys.stderr)
        return INTERRUPTED
