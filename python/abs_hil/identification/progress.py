"""How far an identification is: lines for each stage, and on a terminal one changing line with the time left."""
import sys
import time
from typing import TextIO

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
