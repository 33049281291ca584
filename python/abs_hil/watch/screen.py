"""The picture of a run as lines of text: a pure function of the view. Any size works; what does not fit is left out. Plots are
of the dots of braille, 2 x 4 a cell, or of one ASCII character a cell."""
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

from rich.cells import cell_len
from rich.text import Text

from .view import BUCKETS, PLOTTED, Bucket, RunView, printable

SILENT_AFTER_S = 1.5  # ABS_STATUS comes every second
ALARM, GOOD, DIM, BOLD = 'bold reverse red', 'green', 'dim', 'bold'
FIRST_LINE, SECOND_LINE = 'cyan', 'yellow'
AXIS = 8  # columns of a plot's labels
PLOT_ROWS = 3  # at least: the title and two rows of dots
#: bit of the dot at column x, row y of a braille character (Unicode's table: dots 1 2 3 7 down the left, 4 5 6 8 right)
BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
Range = tuple[float, float]
WORDS = (('ω1', 'w1'), ('ω2', 'w2'), ('θ̂', 'theta'), ('θ', 'theta'), ('µs', 'us'), ('·', ','), ('━', '-'))


@dataclass(frozen=True)
class Screen:
    """Size and abilities of the screen, and where the messages come from."""
    columns: int = 80
    rows: int = 24
    unicode: bool = True
    source: str = ''
    channel: str = ''

    def words(self, text: str) -> str:
        for unicode, ascii in WORDS if not self.unicode else ():
            text = text.replace(unicode, ascii)
        return text if self.unicode else text.encode('ascii', 'replace').decode()


def number(value: float, decimals: int) -> str:
    """A number in few characters, "-" for an unknown one. It comes from the network and may be any double."""
    if math.isnan(value):
        return '-'
    return f'{value:.{decimals}f}' if abs(value) < 1e6 else f'{value:.1e}'


def _flow(items: Iterable[tuple[str, str]], screen: Screen) -> list[Text]:
    """The items (text, style) side by side, two blanks between them, in as many lines as they need. Only an item that is
    longer than a line is broken, between its words."""
    lines: list[Text] = []
    columns = screen.columns
    for text, style in ((screen.words(text), style) for text, style in items):
        if lines and lines[-1].cell_len + 2 + cell_len(text) <= columns:
            lines[-1].append('  ').append(text, style)
            continue
        lines.append(Text())
        for word in text.split(' '):
            if lines[-1].cell_len and lines[-1].cell_len + 1 + cell_len(word) > columns:
                lines.append(Text('  '))
            lines[-1].append(f' {word}' if lines[-1].plain.strip() else word, style)
    return lines


def liveness(view: RunView, now_s: float) -> tuple[str, str]:
    """"1000 messages/s", "no messages for 3.2 s", "waiting for messages", and its style."""
    if (silence_s := view.silence_s(now_s)) is None:
        return 'waiting for messages', ALARM
    if silence_s < SILENT_AFTER_S:
        return f'{view.messages_last_second(now_s)} messages/s', GOOD
    ended = view.telemetry is not None and view.kind_of_phase() in ('stopped', 'fault')
    return f'{"run ended, " if ended else ""}no messages for {silence_s:.1f} s', DIM if ended else ALARM


def _values(view: RunView) -> list[str]:
    v = view.values
    return [f'ω1 {number(v["omega1"], 1):>5} ω2 {number(v["omega2"], 1):>5} rad/s',
            f'slip {number(v["slip"], 3):>6}/{number(v["slip_ref"], 3):<5}', f'θ̂ {number(v["theta_est"], 2):>6} N']


def one_line(view: RunView, now_s: float, screen: Screen) -> str:
    """The run in one line, for a log."""
    parts = []
    if view.telemetry is not None:
        parts = [f'{view.phase():10} {number(view.telemetry.time_s, 3):>7} s']
        parts += [view.fault()] if view.kind_of_phase() == 'fault' else []
        parts += _values(view)
        if view.status is not None:
            parts += [f'overruns {view.status.overruns}', f'drops {view.status.telemetry_drops}']
        parts.append(f'lost {view.lost}')
    return screen.words('  '.join([*parts, liveness(view, now_s)[0]]))


def draw(view: RunView, now_s: float, screen: Screen) -> list[Text]:
    """The whole picture: at most `rows` lines of at most `columns` characters."""
    head = _head(view, now_s, screen)
    if view.telemetry is None and view.status is None:
        foot = _waiting(view, screen)
    else:
        kind = view.kind_of_phase()
        now = view.telemetry if view.telemetry is not None else view.status
        state = [(f'{view.phase():10} {number(now.time_s, 3):>7} s', {'fault': ALARM, 'brake': GOOD}.get(kind, BOLD))]
        state += [(view.fault(), ALARM)] if kind == 'fault' else [(text, '') for text in _values(view)]
        head += _flow(state, screen)
        foot = _foot(view, screen)
    middle = _plots(view, screen.rows - len(head) - len(foot) - 1, screen)
    lines = [*head, *middle, *foot[:max(screen.rows - len(head) - len(middle) - 1, 0)]]
    lines = lines + [Text()] * (screen.rows - 1 - len(lines)) + [Text('q quits', DIM)]
    lines = lines[:max(screen.rows, 0)]
    for line in lines:
        line.truncate(max(screen.columns, 0))
    return lines


def _head(view: RunView, now_s: float, screen: Screen) -> list[Text]:
    e = view.experiment
    names = ' · '.join(printable(name) for name in (e.experiment, e.controller, e.plant, e.backend)) if e else ''
    lines = _flow([('abs_hil watch', BOLD), *([(names, '')] if names else [])], screen)
    live, style = liveness(view, now_s)
    room = screen.columns - lines[-1].cell_len - len(live)
    if room < 2:
        lines.append(Text())
        room = max(screen.columns - len(live), 0)
    lines[-1].append(' ' * room).append(live, style)
    return lines


def _waiting(view: RunView, screen: Screen) -> list[Text]:
    lines = [(f'No message has arrived yet on {screen.channel} at {screen.source}.', ''), ('Start a run:  abs_hil', DIM),
             ('By default messages stay on one computer. To receive from another one, give both programs --lcm-url '
              'udpm://239.255.76.67:7667?ttl=1', DIM)]
    if view.malformed:
        lines.append((f'{view.malformed} packets had no message type of abs_hil', ALARM))
    return [Text(), *(row for line in lines for row in _flow([line], screen))]


def _foot(view: RunView, screen: Screen) -> list[Text]:
    """The controller's signals, timing, counts of errors and the latest events."""
    lines = _flow([(f'{name} {number(value, 4)}', '') for name, value in view.signals().items()], screen)
    if (s := view.status) is None:
        lines += _flow([('timing: no status received yet', DIM)], screen)
    else:
        def quantiles(name: str) -> str:
            return '/'.join(number(getattr(s, f'{name}_{q}_us'), 0) for q in ('p50', 'p99', 'p99_9', 'max'))
        lines += _flow([(f'wake-up {quantiles("wakeup_latency")} cycle {quantiles("cycle_time")} µs, p50/p99/p99.9/max', ''),
                        *([] if s.realtime else [('NOT IN REAL TIME', ALARM)])], screen)
    counts = [] if s is None else [('overruns', s.overruns), ('drops', s.telemetry_drops), ('unpublished', s.publish_failures)]
    counts += [('lost on the way', view.lost)] + ([('malformed', view.malformed)] if view.malformed else [])
    lines += _flow([(f'{name} {count}', ALARM if count else '') for name, count in counts]
                   + ([(f'run {view.runs} seen here', DIM)] if view.runs > 1 else []), screen)
    events: list[Text] = []
    most = min(max(screen.rows - 20, 1), 6)
    for event in reversed(view.events):
        text = f'{number(event.time_s, 3):>8} s {printable(event.kind):8} {printable(event.message or event.reason_text)}'
        rows = _flow([(text, ALARM if event.kind == 'fault' else '')], screen)
        if events and len(events) + len(rows) > most:
            break
        events = rows + events
    return lines + events


def _plots(view: RunView, rows: int, screen: Screen) -> list[Text]:
    """As many plots, one above the other, as have room, and the axis of time."""
    kinds: tuple[tuple[str, tuple[str, str], tuple[str, str], str, Range, Range], ...] = (
        ('slip', ('slip', 'slip_ref'), ('slip', 'wanted'), '-', (0.0, 0.3), (-0.2, 1.0)),
        ('speeds, rad/s', ('omega1', 'omega2'), ('ω1', 'ω2'), '+', (0.0, 10.0), (-1e6, 1e6)),
        ('θ̂, N', ('theta_est', 'theta'), ('θ̂', 'true θ'), '-', (0.0, 10.0), (-1e6, 1e6)))
    count = min((rows - 1) // PLOT_ROWS, len(kinds))
    columns = screen.columns - AXIS
    if count <= 0 or columns < 4 or not view.buckets:
        return []
    lines = []
    left = rows - 1
    for i, (title, (first, second), names, mark, least, most) in enumerate(kinds[:count]):
        height = left // (count - i) - 1
        left -= height + 1
        legend = [(f'{"━" if screen.unicode else m} {name} {number(view.values[quantity], 3)}', style) for name, quantity, style, m
                  in zip(names, (first, second), (FIRST_LINE, SECOND_LINE), ('*', mark))]
        lines.append(Text(' ' * AXIS).append_text(Text('  ').join(_flow([(title, BOLD), *legend], screen))))
        low, high = range_of(view.buckets, (first, second), least, most)
        dots = plot(view.buckets, ((second, SECOND_LINE, mark), (first, FIRST_LINE, '*')), (low, high), columns, height,
                    screen.unicode)
        decimals = 2 if high - low < 5.0 else 0
        labels = {0: number(high, decimals), height - 1: number(low, decimals)}
        lines += [Text(f'{labels.get(row, ""):>{AXIS - 1}} ', DIM).append_text(line) for row, line in enumerate(dots)]
    middle = f'-{view.window_s / 2:g} s'
    axis = f'-{view.window_s:g} s'.ljust(max(columns // 2 - len(middle) // 2, 0)) + middle
    lines.append(Text(' ' * AXIS + axis.ljust(columns - 3) + 'now', DIM))
    return lines


def range_of(buckets: Sequence[Bucket], lines: Sequence[str], least: Range, most: Range) -> Range:
    """Range of the lines' finite values with rounded ends. It includes `least` and never exceeds `most`."""
    numbers = [PLOTTED.index(name) for name in lines]
    values = [v for b in buckets for i in numbers for v in (b.low[i], b.high[i]) if math.isfinite(v)]
    low, high = max(min([*values, least[0]]), most[0]), min(max([*values, least[1]]), most[1])
    step = max(high - low, 1e-9) / 4.0
    power = 10.0 ** math.floor(math.log10(step))
    step = next((f * power for f in (1.0, 2.0, 5.0) if f * power >= step * (1.0 - 1e-12)), 10.0 * power)
    return max(math.floor(low / step + 1e-9) * step, most[0]), min(math.ceil(high / step - 1e-9) * step, most[1])


def plot(buckets: Sequence[Bucket], lines: Sequence[tuple[str, str, str]], limits: Range, columns: int, rows: int,
         unicode: bool) -> list[Text]:
    """The window up to the newest bucket, which stands at the right. lines: (quantity, style, ASCII mark), the last on
    top. Values beyond the limits run along the edge; unknown ones and lost messages make a gap."""
    across, down = (2, 4) if unicode else (1, 1)
    width, height = across * columns, down * rows
    cells = [[(' ', '')] * columns for _ in range(rows)]
    bits = [[0] * columns for _ in range(rows)]

    def row_of_dots(value: float) -> int:
        return round(min(max((limits[1] - value) / (limits[1] - limits[0]), 0.0), 1.0) * (height - 1))

    def column(x: int, top: int, bottom: int, style: str, mark: str) -> None:
        if not 0 <= x < width:
            return
        for y in range(top, bottom + 1):
            bits[y // down][x // across] |= BITS[x % across][y % down]
            cells[y // down][x // across] = (mark, style)

    for name, style, mark in lines:
        i = PLOTTED.index(name)
        before: tuple[int, int, int] | None = None  # x, top, bottom of the bucket before
        for bucket in buckets:
            if bucket.low[i] > bucket.high[i]:
                before = None
                continue
            x = width - 1 - round((buckets[-1].number - bucket.number) / BUCKETS * (width - 1))
            top, bottom = row_of_dots(bucket.high[i]), row_of_dots(bucket.low[i])
            if before is not None and not bucket.after_gap:
                x0, top0, bottom0 = before
                y0 = (top0 + bottom0) // 2
                for between in range(max(x0 + 1, 0), x):  # buckets without a message: the run sends fewer
                    y1 = y0 + round((between - x0) / (x - x0) * ((top + bottom) // 2 - y0))
                    column(between, min(y1, bottom0 + 1), max(y1, top0 - 1), style, mark)
                    top0 = bottom0 = y1
                column(x, min(top, bottom0 + 1), max(bottom, top0 - 1), style, mark)
            else:
                column(x, top, bottom, style, mark)
            before = x, top, bottom
    if unicode:
        cells = [[(chr(0x2800 + b) if b else ' ', style) for b, (_, style) in zip(*row)] for row in zip(bits, cells)]
    return [Text.assemble(*((''.join(c for c, _ in run), style) for style, run in groupby(row, lambda cell: cell[1])))
            for row in cells]
