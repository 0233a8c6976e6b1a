"""Driving by hand with keys or a game pad: alone, or during a mission, which waits meanwhile."""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from math import inf
from threading import Event, Thread
from types import MappingProxyType

from behaviours.run import log
from drivers.api import Base, DeviceStatus, Health, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.loop import guard_callback
from missions.control.pilot import HEAD_KEYS, LATCH_KEY, MAX_STATE_AGE, SPEED_KEYS, DriveInput, Pilot
from missions.plugins.teleop.layout import UnknownPadError
from missions.plugins.teleop.pad import Pad

# What each key means: the keys of ROS's teleop_twist_keyboard, the arrows for the head. Pure; the time is handed in.
#
# A terminal tells of keys that go down and of their auto-repeat, and never of one that is let go. So a key is held
# for as long as it keeps coming.

KEY_HOLD_TIME = 0.75
"""Seconds for which a key counts as held after its first press: longer than the delay of auto-repeat.

That delay is up to 0.66 s, the default of the X server.
"""

REPEAT_HOLD_TIME = 0.3
"""Seconds for which a repeating key counts as held after each repeat.

It is longer than the time between two repeats (0.1 s on some keyboards) and than short delays of the connection.
"""

MAX_REPEAT_INTERVAL = 0.2
"""Seconds between two equal keys that count as auto-repeat; people do not type that fast for long."""


DRIVE_KEYS: Mapping[str, DriveInput] = MappingProxyType(
    {
        "u": DriveInput(1, 1), "i": DriveInput(1, 0), "o": DriveInput(1, -1),
        "j": DriveInput(0, 1), "l": DriveInput(0, -1),
        "m": DriveInput(-1, -1), ",": DriveInput(-1, 0), ".": DriveInput(-1, 1),
    }
)  # fmt: skip
"""Keys that drive, with their directions: ahead (1) or back (-1), and left (1) or right (-1).

As in ROS's teleop_twist_keyboard, ``m`` (back, to the left) turns the base to the right.
"""

STOP_KEY = "k"
END_KEYS = frozenset({"escape", "end"})

KEYS_HELP = """\
u i o    drive: hold a key, release it to stop     q z  faster, slower
j k l    k and every other key stop at once        w x  that ahead alone
m , .    the arrows turn the head                  e c  that of turning alone
space stops until Enter enables again; Esc or Ctrl-C ends"""


class HeldKeys:
    """The key of a terminal that a person holds, if any."""

    def __init__(self) -> None:
        self._key = ""
        self._pressed_at = self._held_until = -inf

    def press(self, key: str, now: float) -> None:
        """Process a key pressed at ``now`` seconds. All keys except those for driving, speed and head stop the base."""
        if key in SPEED_KEYS or key in HEAD_KEYS:
            return
        repeats = key == self._key and now - self._pressed_at <= MAX_REPEAT_INTERVAL
        self._key, self._pressed_at = key, now
        self._held_until = now + (REPEAT_HOLD_TIME if repeats else KEY_HOLD_TIME)

    def push(self, now: float) -> DriveInput | None:
        """Return the drive input at ``now`` seconds; None if no drive key is held."""
        return DRIVE_KEYS.get(self._key) if now <= self._held_until else None


# Taking the wheels: what hands push is passed on to the pilot, again and again, until somebody ends it.

# How late the keys of a terminal are, such as one at the far end of an SSH connection.
#
# The terminal is asked where its cursor is, which every terminal answers by itself, as any VT100 did. Answers and
# keys come in one stream: a key that follows an answer was pressed by a person who has seen all that was shown before
# the question.

QUERY_INTERVAL = 0.1
"""Seconds between two queries of the terminal's cursor position."""

MAX_OPEN_QUERIES = 8
"""Maximum number of unanswered queries to a terminal. Answers that come after the end would be read by the shell."""

ANSWER_TIMEOUT = 60.0
"""Seconds after which a query to the terminal counts as lost."""

FIRST_ANSWER_TIMEOUT = 12.0
"""Seconds after which a local terminal that has answered no query is assumed never to answer.

Its keys then drive although the delay is unknown. The time is longer than the round trip of the slowest line, 5 s each
way.
"""

FIRST_ROW = 2
"""Terminal row of the first query. It is not 1, since an answer with row 1 looks like the key Shift-F3."""


class LineDelay:
    """Measures the delay of a terminal by cursor position reports; ``size`` returns its columns and rows.

    Each query moves the cursor to its own place, so each answer belongs to one query. ``remote`` is True if the
    terminal may be on another machine. ``relay`` names a program such as tmux that answers in place of the terminal, or
    is empty. With ``allow_unknown``, keys drive even if the delay is unknown.
    """

    def __init__(
        self,
        write: Callable[[str], object],
        clock: Clock,
        size: Callable[[], tuple[int, int]],
        *,
        remote: bool = False,
        relay: str = "",
        allow_unknown: bool = False,
    ) -> None:
        self._write, self._clock, self._size = write, clock, size
        self._remote, self._relay, self._allow_unknown = remote, relay, allow_unknown
        self._started_at = clock.now()
        self._open_queries: OrderedDict[tuple[int, int], float] = OrderedDict()
        self._query_count = 0
        self._last_query_at = -inf
        self._answered_query_at = -inf
        self._round_trip = inf

    def send_query(self) -> None:
        """Query the terminal, at most every ``QUERY_INTERVAL``. The cursor is restored at once."""
        now = self._clock.now()
        while self._open_queries and now - next(iter(self._open_queries.values())) > ANSWER_TIMEOUT:
            self._open_queries.popitem(last=False)
        if self._relay or now - self._last_query_at < QUERY_INTERVAL or len(self._open_queries) >= MAX_OPEN_QUERIES:
            return
        self._last_query_at = now
        columns, rows = self._size()
        row, column = divmod(self._query_count, max(1, columns))
        place = min(FIRST_ROW, rows) + row % max(1, rows - FIRST_ROW + 1), column + 1
        self._query_count += 1
        self._open_queries[place] = now
        self._write(f"\x1b7\x1b[{place[0]};{place[1]}H\x1b[6n\x1b8")

    def on_answer(self, row: int, column: int) -> None:
        """Process an answer of the terminal; one without a query is ignored."""
        if (row, column) not in self._open_queries:
            return
        place = None
        while place != (row, column):  # those before it are lost, for answers keep their order
            place, self._answered_query_at = self._open_queries.popitem(last=False)
        self._round_trip = self._clock.now() - self._answered_query_at

    @property
    def has_open_queries(self) -> bool:
        """True while the terminal has not answered all queries."""
        return bool(self._open_queries)

    @property
    def refusal(self) -> str:
        """Reason why keys do not drive now; empty if they do."""
        now = self._clock.now()
        if self._answered_query_at == -inf:
            waits = self._remote or now - self._started_at < FIRST_ANSWER_TIMEOUT
            if self._allow_unknown or not waits:
                return ""
            reason = f"{self._relay} answers for the terminal" if self._relay else "the terminal does not answer"
            return f"delay unknown: {reason}"
        return (
            f"line too slow: {now - self._answered_query_at:.1f} s ({MAX_STATE_AGE:g} s at most)"
            if self.is_late
            else ""
        )

    @property
    def is_late(self) -> bool:
        """True if the terminal has answered, but the query that it answered last was sent too long ago."""
        return self._answered_query_at > -inf and self._clock.now() - self._answered_query_at >= MAX_STATE_AGE

    def status_text(self) -> str:
        """Return the reason why keys do not drive, or the round trip; empty if it is unknown."""
        return self.refusal or ("" if self._answered_query_at == -inf else f"{1000 * self._round_trip:.0f} ms")


COMMAND_INTERVAL = 0.05
"""Seconds between two drive commands. A command expires after 0.3 s, so five commands in a row may be lost."""


def drive_by_hand(
    pilot: Pilot,
    read_key: Callable[[float], str],
    pad: Pad | None,
    clock: Clock,
    show: Callable[[str], None],
    line: LineDelay | None = None,
) -> None:
    """Let a person drive, with the keys from ``read_key`` or with an open ``pad``, until a key ends it.

    ``read_key`` waits for at most the given seconds, and returns an empty text without a key; ``show`` displays a
    status line. Keys that queued up while the process was suspended (SIGSTOP, a stalled line) do not drive. While
    ``line`` reports a delay that is too long, keys neither drive nor turn the head; afterwards the person must first
    release all keys. At the end the base is released in any case. Raises NotConnected when the pad disconnects.
    """
    hand = HeldKeys() if pad is None else pad
    before, late, refused = clock.now(), False, False
    try:
        while True:
            key, now = read_key(COMMAND_INTERVAL), clock.now()
            if now - before > REPEAT_HOLD_TIME:
                key = _flush_keys(key, read_key)
            if key in END_KEYS:
                return
            before = now
            if line is not None and pad is None:
                late = line.is_late or (late and hand.push(now) is not None)
                refused = late or bool(line.refusal)
            for each in (key, *(() if pad is None else pad.read_keys())):
                if each:
                    hand.press(each, now)
                    if not (refused and each in HEAD_KEYS):
                        pilot.press(each)
            pilot.steer(None if refused else hand.push(now))
            parts = [pilot.status_line()]
            if line is not None:
                line.send_query()
                parts = ["release all keys" if refused and not line.refusal else line.status_text(), *parts]
            show(" | ".join(filter(None, parts)))
    finally:
        pilot.steer(None)


def _flush_keys(key: str, read_key: Callable[[float], str]) -> str:
    """Read the queued keys after ``key``; return the first that ends driving, else LATCH_KEY if there is one.

    Otherwise return STOP_KEY.
    """
    found = STOP_KEY
    while key and key not in END_KEYS:
        found = LATCH_KEY if LATCH_KEY in (key, found) else STOP_KEY
        key = read_key(0.0)
    return key or found


RETRY_INTERVAL = 1.0
"""Seconds between two attempts to find the pad."""


class PadDevice:
    """A ``drivers.api.Device`` that reads a game pad and commands ``base``, on its own thread.

    ``make_pad`` returns the pad, plugged in or not; it is called at each attempt, and may return a different pad.
    """

    name = "pad"

    def __init__(
        self, base: Base, make_pad: Callable[[], Pad], clock: Clock, *, report: StatusCallback = ignore
    ) -> None:
        self._pilot = Pilot(base)
        self._make_pad = make_pad
        self._clock = clock
        self._report = guard_callback(report)
        self._closing = Event()
        self._thread: Thread | None = None
        self._health = Health(False, "pad: not opened yet")

    def open(self) -> None:
        """Start looking for the pad; returns at once."""
        if self._thread is None:
            self._closing.clear()
            self._thread = Thread(target=self._run, name="pad", daemon=True)
            self._thread.start()

    def rest(self) -> None:
        """Do nothing: the base stops by itself without commands."""

    def close(self) -> None:
        """Release the base and end the thread. Safe from any state, more than once."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def health(self) -> Health:
        return self._health

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._read_pad()
            except NotConnected as error:
                self._set_offline(str(error), error.hint, refused=isinstance(error, UnknownPadError))
            except Exception as error:  # any error: the pad must not seem to be connected
                log.exception("the pad cannot be read")
                self._set_offline(f"pad: {type(error).__name__}: {error}", "")

    def _set_offline(self, reason: str, hint: str, *, refused: bool = False) -> None:
        """Report once that the pad is missing or refused, and wait for ``RETRY_INTERVAL``."""
        if self._health.online or (refused and reason != self._health.detail):
            self._report(DeviceStatus(self.name, "offline", reason, hint))
        self._health = Health(False, reason, hint)
        self._closing.wait(RETRY_INTERVAL)

    def _read_pad(self) -> None:
        """Drive with the pad until it disconnects, or the device is closed."""
        pad = self._make_pad()
        pad.open()
        self._health = Health(True)
        self._report(DeviceStatus(self.name, "online", f"{pad.path}: a game pad"))
        try:
            drive_by_hand(self._pilot, self._wait, pad, self._clock, _discard_line)
        finally:
            pad.close()

    def _wait(self, seconds: float) -> str:
        """Wait for ``seconds``; return the key "end" if the device is closed, else an empty text."""
        return "end" if self._closing.wait(seconds) else ""


def _discard_line(line: str) -> None:
    """Ignore the status line of hand driving: a mission shows a line of its own."""
    del line
