"""The state of a run as far as its messages show it. Messages may be missing, and a new run may begin at any time."""
import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

from ..messages import PHASES, QUANTITIES, REASONS, row_of

#: The plotted quantities. Speeds and slip are true values where they are known, else estimates.
PLOTTED = ('slip', 'slip_ref', 'omega1', 'omega2', 'theta_est', 'theta')
#: A plot's window has so many buckets: more than a terminal has dots.
BUCKETS = 400
#: Networks may deliver a few messages out of order. A sequence number further back belongs to another run.
LATE_MESSAGES = 16
#: A wheel whose counter has not changed for this time stands still, whatever the estimate says.
STANDS_AFTER_S = 0.1
#: Below this speed of the lower wheel, slip is a quotient of two errors: it counts as unknown.
SLIP_FROM_RAD_S = 5.0
LONGEST_TEXT = 200
MOST_SIGNALS = 16


def printable(text: str) -> str:
    """A text from the network, safe for a terminal."""
    return ''.join(c if c.isprintable() else '?' for c in text[:LONGEST_TEXT])


@dataclass
class Bucket:
    """Least and largest values of a short time; low > high: unknown. after_gap: messages before it were lost."""
    number: int
    after_gap: bool
    low: list[float] = field(default_factory=lambda: [math.inf] * len(PLOTTED))
    high: list[float] = field(default_factory=lambda: [-math.inf] * len(PLOTTED))


class RunView:
    """Takes messages with the receiver's monotonic time, s. Keeps `window_s` of run time for the plots."""

    def __init__(self, window_s: float) -> None:
        self.window_s = window_s
        self.malformed = 0                   # packets that are no message of abs_hil
        self.runs = 0                        # seen, including the present one
        self.heard_s: float | None = None    # when the last message came
        self._begin_run()

    def _begin_run(self) -> None:
        self.runs += 1
        self.telemetry: Any = None
        self.status: Any = None
        self.experiment: Any = None
        self.events: deque[Any] = deque(maxlen=20)
        self.buckets: deque[Bucket] = deque(maxlen=BUCKETS + 1)
        self.values = dict.fromkeys(PLOTTED, math.nan)
        self.lost = 0                        # telemetry messages of this run that were sent and did not arrive
        self._latest: dict[str, int] = {}    # sequence number of each type
        self._arrivals: deque[float] = deque()
        self._moved: dict[str, tuple[int, float]] = {}

    def take(self, message: Any, now_s: float) -> None:
        kind = type(message).__name__
        self.heard_s = now_s
        latest = self._latest.get(kind, -1)
        # A command is answered between two runs of a series with new sequence numbers: the ended run stays in view.
        answer = kind == 'event_t' and message.kind == 'command' and message.sequence <= latest
        if message.sequence <= latest and not answer:
            if message.sequence > max(latest - LATE_MESSAGES, 0):
                return
            self._begin_run()
            latest = -1
        if not answer:
            self._latest[kind] = message.sequence
        if kind == 'event_t':
            self.events.append(message)
        elif kind == 'telemetry_t':
            self._take_cycle(message, 0 <= latest < message.sequence - 1, now_s)
            self.lost += message.sequence - latest - 1 if latest >= 0 else 0
        else:
            setattr(self, kind.removesuffix('_t'), message)

    def _take_cycle(self, message: Any, after_gap: bool, now_s: float) -> None:
        self.telemetry = message
        self._arrivals.append(now_s)
        while self._arrivals[0] <= now_s - 1.0:
            self._arrivals.popleft()
        if not math.isfinite(message.time_s):
            return
        omega2 = self._speed('lower', message.omega2_rad_s, message.omega2_est_rad_s)
        slip = message.slip_est if math.isnan(message.slip) else message.slip
        self.values = dict(zip(PLOTTED, (
            slip if abs(omega2) >= SLIP_FROM_RAD_S else math.nan, message.slip_ref,
            self._speed('upper', message.omega1_rad_s, message.omega1_est_rad_s), omega2,
            message.theta_est_N, message.theta_N)))
        number = math.floor(message.time_s / self.window_s * BUCKETS)
        if not self.buckets or after_gap or number != self.buckets[-1].number:
            self.buckets.append(Bucket(number, after_gap))
        bucket = self.buckets[-1]
        bucket.low = list(map(min, bucket.low, self.values.values()))  # an unknown value is neither
        bucket.high = list(map(max, bucket.high, self.values.values()))

    def _speed(self, wheel: str, true: float, estimated: float) -> float:
        if not math.isnan(true):
            return true
        message = self.telemetry
        counts = getattr(message, f'{wheel}_counts')
        if wheel not in self._moved or counts != self._moved[wheel][0]:
            self._moved[wheel] = counts, message.time_s
        stands = message.sample_valid and message.time_s > self._moved[wheel][1] + STANDS_AFTER_S
        return 0.0 if stands else estimated

    def silence_s(self, now_s: float) -> float | None:
        """Time since the last message; None if none has come."""
        return None if self.heard_s is None else max(now_s - self.heard_s, 0.0)

    def messages_last_second(self, now_s: float) -> int:
        return sum(arrival > now_s - 1.0 for arrival in self._arrivals)

    def kind_of_phase(self) -> str:
        number = (self.telemetry or self.status).phase
        return PHASES[number] if 0 <= number < len(PHASES) else 'fault'

    def phase(self) -> str:
        """The experiment's own name of the phase, else that of its kind."""
        own = self.telemetry.phase_name if self.telemetry is not None else ''
        return printable(own)[:40] if own and self.kind_of_phase() != 'fault' else self.kind_of_phase()

    def signals(self) -> dict[str, float]:
        """The latest values of the controller's own signals."""
        row = row_of(self.telemetry) if self.telemetry is not None else {}
        own = [name for name in row if name not in QUANTITIES and name != 'phase_name'][:MOST_SIGNALS]
        return {printable(name)[:40]: row[name] for name in own}

    def fault(self) -> str:
        """Why the run ended in a fault, in words: of the event or, if that was lost, of the reason's number."""
        for event in reversed(self.events):
            if event.kind == 'fault':
                return printable(event.message or event.reason_text)
        reason = self.telemetry.reason if self.telemetry is not None else 0
        return REASONS[reason]['text'] if reason != 0 and reason in REASONS else 'reason not received'
