"""The command lines of the programs in Python, by name (abs_hil.programs). This module imports nothing but Python's own, so
that --help, --version and a wrong option need no package."""
import argparse
import pathlib
import re
import textwrap
from collections.abc import Callable

#: formats of figures as files, and of exported rows
PICTURES, EXPORTS = ('pdf', 'png', 'svg'), ('csv', 'json', 'octave', 'parquet')
#: what varies from episode to episode by default, as `abs_hil compare --vary`
VARY = 'parameters=0.1,theta=0.1,phase'
PORT, FOXGLOVE_PORT = 8265, 8765
_INF = float('inf')
#: what --reading may tell of a trace's readings: key -> unit, range, meaning
READINGS = {
    'from_s': ('s', -_INF, _INF, 'first time that is used: both wheels roll on each other [the first row]'),
    'to_s': ('s', -_INF, _INF, 'last time that is used [the last row]'),
    'window_s': ('s', 0.0, 0.2, 'a reading is the mean over so long [0]'),
    'speed_age_s': ('s', 0.0, 0.2, 'the window of a speed ended so long before its time [0]'),
    'slip_age_s': ('s', 0.0, 0.2, 'the window of a slip ended so long before its time [0]'),
    'speed_resolution': ("of the file's speeds", 0.0, _INF, 'a speed is given in steps of this [the least step]'),
    'slip_resolution': ('1', 0.0, 1.0, 'a slip is given in steps of this [the least step]'),
    'relay_below': ('1', 0.0, 1.0, "the brake's duty was 1 while the slip as read was below this, else 0"),
    'brake_duty': ('1', 0.0, 1.0, "the brake's duty from brake_from_s on"),
    'brake_from_s': ('s', -_INF, _INF, 'the brake began about then: the instant is fitted, within 0.02 s'),
}
Parser = Callable[[], argparse.ArgumentParser]
#: endings of all files that programs of this project write or read
_FORMATS = ('.csv', '.json', '.html', '.lcmlog', '.mcap', '.parquet', '.pdf', '.svg', '.png', '.md', '.toml', '.mat', '.fmu',
            '.xlsx', '.txt')


class _WholeWords(argparse.HelpFormatter):
    """Help that is broken at spaces alone: no name is cut at its dashes."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(' '.join(text.split()), width, break_long_words=False, break_on_hyphens=False)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return '\n'.join(indent + line for line in self._split_lines(text, width - len(indent)))


def _program(prog: str, description: str) -> Callable[[Callable[[argparse.ArgumentParser], None]], Parser]:
    """Makes the function that gives a program's parser of one that adds its arguments."""
    def decorated(add: Callable[[argparse.ArgumentParser], None]) -> Parser:
        def parser() -> argparse.ArgumentParser:
            made = argparse.ArgumentParser(prog, description=description, allow_abbrev=False, formatter_class=_WholeWords)
            made.add_argument('--version', action='store_true', help='show version and commit, and exit')  # abs_hil.programs does
            add(made)
            return made
        return parser
    return decorated


def whole(least: int, most: int) -> Callable[[str], int]:
    """A type of argparse: a whole number of this range."""
    def number(text: str) -> int:
        if not text.strip().lstrip('+-').isdecimal() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f'"{text}" is no whole number from {least} to {most}')
        return int(text)
    return number


def to_write(*endings: str) -> Callable[[str], pathlib.Path]:
    """A type of argparse: a file to write, or without endings a folder, whose name promises no other format."""
    def path(text: str) -> pathlib.Path:
        if text.endswith(_FORMATS) and not (endings and text.endswith(endings)):
            raise argparse.ArgumentTypeError(f'"{text}": give ' + (' or '.join(f'FILE{one}' for one in endings) or 'a folder'))
        return pathlib.Path(text)
    return path


def reading(text: str) -> tuple[str, float]:
    """A type of argparse: KEY=VALUE of READINGS."""
    key, _, number = text.partition('=')
    if key not in READINGS:
        raise argparse.ArgumentTypeError(f'{text}: no such key; give one of {", ".join(READINGS)}')
    unit, least, most, what = READINGS[key]
    try:
        value = float(number)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text}: "{number}" is no number') from None
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f'{text}: give a number from {least:g} to {most:g} ({unit}): {what}')
    return key, value


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f'"{text}" is no number in [0, 65535]; LOG stands before --foxglove')
    return int(text)


@_program('abs_report', 'Turns runs into a page with figures and tables, a plain table, or exports their rows')
def report(made: argparse.ArgumentParser) -> None:
    made._negative_number_matcher = re.compile(r'-[\d.]')  # --window -5:1 has a value
    made.add_argument('runs', metavar='RUN', nargs='+',
                      help='run folders, series folders, files of runs (event log, CSV, MCAP, Parquet); or the folder of a study')
    made.add_argument('--out', '--output', metavar='FILE', default='', dest='output',
                      help='file of the page (default: report.html) or of the exported rows (default: stdout)')
    made.add_argument('--force', action='store_true', help='replace existing files')
    made.add_argument('--title', metavar='TEXT', default='', help='heading of the page')
    made.add_argument('--label', metavar='TEXT', dest='labels', action='append', default=[],
                      help='name of each run in legends and tables, one per run')
    made.add_argument('--window', default='brake', metavar='brake|run|FROM:TO',
                      help='time range of the figures: brake, run, or FROM:TO in seconds of the run [brake]')
    made.add_argument('--metric', metavar='A,B', dest='metrics', action='append', default=[],
                      help='of a study: the metrics whose curves and maps the page shows')
    made.add_argument('--paper', action='store_true',
                      help="make the paper's comparison page from an adaptive and a sliding-mode run")
    made.add_argument('--figures', metavar='DIR', default='', help='folder for the figures as separate files')
    made.add_argument('--format', choices=PICTURES, default=None, help='format of these files [svg]')
    made.add_argument('--table', action='store_true', help='print the figures of merit as a plain table; makes no page')
    made.add_argument('--merits', metavar='FILE', type=to_write('.csv'),
                      help='write the figures of merit as CSV, one row a run, numbers in full')
    one = made.add_argument_group('export', 'export rows instead of a page, to --out or stdout').add_mutually_exclusive_group()
    for kind, what in zip(EXPORTS, ("all runs in one CSV, with the run's name in the first column", 'runs with summaries, one '
                                    'array per column', 'MAT-file for Octave, MATLAB, SciPy', 'Parquet file')):
        one.add_argument(f'--{kind}', dest='export', action='store_const', const=kind, help=what)
    made.add_argument('--columns', metavar='A,B', action='append', default=[],
                      help='columns to export, separated by commas (default: all)')


@_program('abs_tune', "Searches for a controller's gains in simulation and writes them as a configuration file")
def tune(made: argparse.ArgumentParser) -> None:
    made.add_argument('--controllers', '--controller', metavar='A,B,...',
                      help='controllers to tune (default: all that have gains)')
    made.add_argument('--plants', metavar='A,B,...', default='paper-table1,paper-timing',
                      help='plants to tune on [paper-table1,paper-timing]')
    made.add_argument('--model', metavar='NAME|FILE', help="the controllers' model, by name or TOML file (default: each plant)")
    made.add_argument('--out', '--folder', metavar='DIR', required=True, type=to_write(), dest='folder',
                      help='folder for CONTROLLER.toml; made if there is none')
    made.add_argument('--cases', metavar='N', default=6, type=whole(1, 1000), help='varied plants for each plant [6]')
    made.add_argument('--generations', metavar='N', default=24, type=whole(1, 10_000), help='generations of the search [24]')
    made.add_argument('--seed', metavar='N', default=1, type=whole(0, 2**63 - 1), help='seed of the search [1]')
    made.add_argument('--threads', metavar='N', default=0, type=whole(0, 1024),
                      help='number of threads, 0: one for each processor; does not change the results [0]')


@_program('abs_learn', 'Trains a small controller in simulation by trial and error, and compares it with laws of the '
          'program (docs/learning.md)')
def learn(made: argparse.ArgumentParser) -> None:
    made.add_argument('--plant', metavar='NAME|FILE', default='paper-timing', help='nominal plant [paper-timing]')
    made.add_argument('--vary', metavar='SPEC', default=VARY, help=f'what varies between episodes [{VARY}]')
    made.add_argument('--generations', metavar='N', type=whole(1, 10**6), default=60, help='generations of the search [60]')
    made.add_argument('--seed', metavar='N', type=whole(0, 2**63 - 1), default=1, help='seed of the search [1]')
    made.add_argument('--judge', metavar='N', type=whole(1, 10**6), default=100, help='plants on which the result is judged [100]')
    made.add_argument('--out', '--output', metavar='FILE', type=to_write('.json'), dest='output',
                      help='write the weights and the curve as JSON')
    made.add_argument('--figure', metavar='FILE', type=pathlib.Path, help='draw the learning curve (SVG, PDF or PNG)')


@_program('abs_identify', "Estimates the rig's parameters from its own logs and writes a model file (docs/identification.md)")
def identify(made: argparse.ArgumentParser) -> None:
    made.add_argument('logs', metavar='LOG', nargs='*', help='run folders, event logs, or CSV files with time_s, upper_counts, '
                      'lower_counts, brake_pwm, motor_pwm and, if there, phase and wheels_apart; gzip or not')
    made.add_argument('--speeds', metavar='FILE', action='append', default=[], help='instead of logs, a CSV file of coarse wheel '
                      'speeds: time_s and some of upper_rpm, lower_rpm (also _rad_s, _m_s), slip, brake_pwm, motor_pwm; may be '
                      'repeated')
    made.add_argument('--reading', metavar='KEY=VALUE', action='append', dest='speeds', type=reading, help='how the --speeds FILE '
                      'before it was read, or, before the first one, all of them: '
                      + '; '.join(f'{key}: {row[-1]}' for key, row in READINGS.items()))
    made.add_argument('--start', metavar='NAME|FILE', default='paper-table1',
                      help='plant with the given J2 and r2, and what the logs do not tell [paper-table1]')
    made.add_argument('--fix', metavar='KEY[=VALUE]', action='append', default=[],
                      help="leave a parameter at its start's value, or at this one: J2_kg_m2=0.0266")
    made.add_argument('--drift', metavar='KEY', action='append', default=[],
                      help='a factor that may differ from log to log: brake_torque')
    made.add_argument('--form', metavar='NAME', default='auto', help='form of the plant: magic-formula, inteco-mu, or auto: the '
                      'one that better predicts left-out logs [auto]')
    made.add_argument('--validate', metavar='FOLDER', help='run folder, not among the logs, whose stop is predicted')
    made.add_argument('--out', metavar='DIR', type=to_write(), default=pathlib.Path('identified'),
                      help='folder for model.toml, identified.json and report.html [identified]')
    made.add_argument('--force', action='store_true', help='replace existing files')
    made.add_argument('--seed', metavar='N', type=whole(0, 2**63 - 1), default=1, help='seed of the bootstrap [1]')
    made.add_argument('--no-report', action='store_true', help='write no page, and advise nothing')


@_program('abs_hil benchmark', 'How near to the shortest braking a controller comes, over a fixed set of cases.')
def benchmark(made: argparse.ArgumentParser) -> None:
    made.add_argument('--controller', '--controllers', metavar='C,...', action='append', default=[],
                      help='names, FILE.so, FILE.fmu, or MODULE:CLASS of controllers in Python; may be repeated '
                      '(all controllers of the program)')
    made.add_argument('--set', metavar='KEY=VALUE', action='append', default=[],
                      help='a value under control. for every controller; may be repeated')
    made.add_argument('--quick', action='store_true', help='12 cases with one seed: a check, no score')
    made.add_argument('--warm', action='store_true',
                      help='scores laws that keep something of the last braking also after one braking of each case')
    made.add_argument('--draw', metavar='SEED', type=whole(0, 2**63 - 1), help='only cases that this seed draws; needs casadi')
    made.add_argument('--count', metavar='N', type=whole(1, 10_000), help='how many of them (as many as the set has)')
    made.add_argument('--bounds', metavar='FILE', type=pathlib.Path,
                      help='keeps the bounds of drawn cases, so that they need not be computed again')
    made.add_argument('--verify', metavar='FILE', type=pathlib.Path,
                      help='makes the runs of a file of --json again; status 1 if anything differs')
    made.add_argument('--threads', metavar='N', type=whole(0, 1024), default=0, help='0: one for each processor')
    made.add_argument('--json', metavar='FILE', type=to_write('.json'), help='all scores and runs')
    made.add_argument('--out', '--page', metavar='FILE', type=to_write('.html', '.md'), dest='page',
                      help='the page with the groups of cases: HTML with figures for FILE.html, otherwise Markdown')


@_program('abs_convert', 'Converts a recorded run, or records a running one, for PlotJuggler, Foxglove and others '
          '(docs/interchange.md)')
def convert(made: argparse.ArgumentParser) -> None:
    made.add_argument('files', nargs='*', metavar='FILE', help='IN: run folder, event log (.lcmlog), CSV, MCAP or Parquet; IN#2: '
                      'the second run of a file; then OUT, the file to write')
    made.add_argument('--out', metavar='OUT', help='file to write: .csv, .mcap or .parquet; the last FILE otherwise')
    made.add_argument('--live', metavar='URL', help='record a running experiment from this LCM network; "" is the default one')
    made.add_argument('--prefix', default='ABS_', help='its telemetry.channel_prefix (default: %(default)s)')
    made.add_argument('--idle', type=float, metavar='S', help='with --live: end S seconds after the last message')
    made.add_argument('--seconds', type=float, metavar='S', help='with --live: end after S seconds')


@_program('abs_watch', 'Shows a running experiment in this terminal, over LCM; q quits (docs/watching.md)')
def watch(made: argparse.ArgumentParser) -> None:
    made.add_argument('--lcm-url', default='', metavar='URL', help='LCM network (default: LCM_DEFAULT_URL, else UDP multicast)')
    made.add_argument('--prefix', default='ABS_', help="the run's telemetry.channel_prefix [%(default)s]")
    made.add_argument('--window', type=float, default=10.0, metavar='S', help='width of the plots, 1 to 60 s [%(default)g]')
    made.add_argument('--ascii', action='store_true', help='use ASCII only, for a terminal that shows braille badly')
    how = made.add_mutually_exclusive_group()
    how.add_argument('--plain', action='store_true', help='print a line a second, no screen; always so without a terminal')
    how.add_argument('--once', action='store_true', help='print one screen as text; exit status 3 if no message arrives')
    made.add_argument('--timeout', type=float, metavar='S', help='longest wait of --once for messages, s [5]')


@_program('abs_hil export-fmu', 'Writes the simulated rig, or with --controller a slip controller, as an FMU for other '
          'tools (docs/interchange.md)')
def export_fmu(made: argparse.ArgumentParser) -> None:
    made.add_argument('--config', metavar='FILE', help='TOML file with any configuration values')
    made.add_argument('--plant', metavar='NAME|FILE', help='simulated plant by name or TOML file')
    made.add_argument('--model', metavar='NAME|FILE', help="the controllers' model of the rig, by name or TOML file (default: the "
                      'plant)')
    made.add_argument('--controller', metavar='NAME', help='export this slip controller')
    made.add_argument('--set', metavar='KEY=VALUE', action='append', help='set any configuration value (abs_hil list --keys); may '
                      'be repeated')
    made.add_argument('--fmi', metavar='N', type=int, default=2, help='version of FMI, 2 or 3 [%(default)s]')
    made.add_argument('--out', metavar='FILE.fmu', type=to_write('.fmu'), required=True, help='file to write')
    made.add_argument('--force', action='store_true', help='replace an existing file')


@_program('abs_serve', 'Shows a running experiment, or a recorded one, as a scope in the browser (docs/serve.md). It '
          'only watches unless --commands is given.')
def serve(made: argparse.ArgumentParser) -> None:
    made.add_argument('log', nargs='?', metavar='LOG', help='event log (.lcmlog), run folder, CSV, MCAP or Parquet to play '
                      'instead of receiving; LOG#2: the second run of a file')
    made.add_argument('--speed', type=float, default=1.0, metavar='X', help='with LOG: times as fast as recorded; 0: at once '
                      '(default: %(default)g)')
    made.add_argument('--lcm-url', default='', metavar='URL', help="the LCM network (default: the run's own default)")
    made.add_argument('--prefix', default='ABS_', help="the run's telemetry.channel_prefix (default: %(default)s)")
    made.add_argument('--host', default='127.0.0.1', help="address to listen at; other than this computer's own, the link has a "
                      'token (default: %(default)s)')
    made.add_argument('--port', type=int, default=PORT, help='port to listen at; 0: any free one (default: %(default)d)')
    made.add_argument('--commands', metavar='KEYFILE', help='the page may send what `abs_hil send` may, with this key '
                      '(commands.key_file of the run); the link has a token')
    made.add_argument('--foxglove', nargs='?', const=FOXGLOVE_PORT, type=_port, metavar='PORT', help='serve Foxglove, Lichtblick '
                      'and PlotJuggler too (foxglove.sdk.v1), always at 127.0.0.1 (default: %(const)d; 0: any free one)')


@_program('abs_hil lab', 'A page that simulates the rig and its controllers in the browser, without a server.')
def lab(made: argparse.ArgumentParser) -> None:
    made.add_argument('--out', metavar='FILE', type=to_write('.html'), default=pathlib.Path('lab.html'), help='page [lab.html]')
    exercises = sorted(path.stem for path in (pathlib.Path(__file__).parent / 'lab' / 'exercises').glob('*.toml'))
    made.add_argument('--exercise', metavar='FILE', help='a TOML file that says what the page asks, hides and offers; or one that '
                      'is ready: ' + ', '.join(exercises))


@_program('abs_log', 'Says what recordings hold (docs/telemetry.md)')
def log(made: argparse.ArgumentParser) -> None:
    made.add_argument('what', choices=('info',), help='format, runs, duration, channels, gaps, result')
    made.add_argument('files', nargs='+', metavar='FILE', help="run folder, anybody's event log, CSV, MCAP or Parquet of a run")
    made.add_argument('--json', action='store_true', help='print it as JSON: a list with an object for each file')


@_program('abs_hil rig', 'Writes a simulated rig that a class does not know, as a file for --plant (docs/class.md)')
def rig(made: argparse.ArgumentParser) -> None:
    made.add_argument('kind', choices=('steady', 'wandering'), help='whether it changes a little all the time')
    made.add_argument('seed', metavar='SEED', type=whole(0, 2**63 - 1), help='which one; the same number is the same rig')
    made.add_argument('--out', metavar='FILE', type=to_write('.toml'), default=pathlib.Path('rig.toml'), help='[rig.toml]')
    made.add_argument('--force', action='store_true', help='replace an existing file')


# abs_hil itself starts these two, which have no options.
compare_tables = _program('abs_compare_tables', 'Makes the tables of abs_hil compare, which starts it (docs/comparison.md).')(
    lambda _: None)
python_host = _program('abs_python_host', 'Runs a controller in Python. abs_hil starts it, for --controller MODULE:CLASS '
                       '(docs/interchange.md).')(lambda _: None)
