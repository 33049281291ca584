"""Plots of characters: the dots of braille, 2 x 4 a cell, or one ASCII character a cell."""
import math
from collections.abc import Sequence
from itertools import groupby

from rich.text import Text

from .view import BUCKETS, PLOTTED, Bucket

#: bit of the dot at column x, row y of a braille character (Unicode's table: dots 1 2 3 7 down the left, 4 5 6 8 right)
BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
Range = tuple[float, float]


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
