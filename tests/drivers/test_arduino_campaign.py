"""Random resets, stalls and reconnects of boards of all kinds: no servo is told to take a step wider than the ramp.

The stand-in has the order in which the sketch does things; the line has late bytes, and keeps them while nobody reads.
"""

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from math import radians
from random import Random

from drivers.api import DeviceStatus, HeadPose, Health
from drivers.arduino import wire
from drivers.arduino.board import ArduinoBoard
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.session import MAX_PROOF_AGE, NO_SESSION_TIME_REQUESTS, PROBE_TIMEOUT, SESSION_TIMEOUT
from drivers.arduino.virtual import ENCODER_SKETCH_ANGLES, FIRST_SKETCH_ANGLES, VirtualRodney
from drivers.clock import ManualClock
from drivers.errors import DriverError, NotConnected
from drivers.head.axis import ServoAxis
from drivers.head.pantilt import MAX_CATCH_UP
from drivers.transport.link import LinkHandler, SerialLink
from tests.tries import tries

SPEED = 120
"""Degrees per second, as in the robot files."""

RAMP = SPEED * (MAX_PROOF_AGE + MAX_CATCH_UP) + 2
"""The widest step in degrees: what the ramp covers between two proofs, in whole degrees."""

TIME_REPLY = wire.RosserialFrame(wire.TIME, bytes(8)).pack()[:7]
"""First bytes of a reply to a time request."""

KERNEL = 4095
"""Bytes that the kernel keeps for who does not read."""

TRIALS = tries(125, most=500)

BOARDS: dict[str, Callable[[], VirtualRodney]] = {
    "first sketch, Nano": lambda: VirtualRodney(logs_angles=True, start_angles=FIRST_SKETCH_ANGLES, boot_delay=1.0),
    "first sketch, no boot loader": lambda: VirtualRodney(
        logs_angles=True, start_angles=FIRST_SKETCH_ANGLES, boot_delay=0.07
    ),
    "later sketch, Nano": lambda: VirtualRodney(
        tacho=True, logs_angles=True, start_angles=ENCODER_SKETCH_ANGLES, boot_delay=1.6
    ),
    "later sketch, Teensy": lambda: VirtualRodney(tacho=True, boot_delay=0.4, native_usb=True),
    "a sketch that tells nothing": lambda: VirtualRodney(start_angles=FIRST_SKETCH_ANGLES, boot_delay=0.5),
}


class Line(SerialLink):
    """A port without a thread, whose bytes are late; the test turns the crank, unevenly."""

    def __init__(self, device: VirtualRodney, clock: ManualClock, random: Random) -> None:
        super().__init__("head", "/dev/nano", 57600)
        self.device, self.clock, self.random = device, clock, random
        self.plugged = self.keeps_dtr = False
        self.replied_at = clock.now()  # when the driver last replied to a time request
        self.talker: LinkHandler | None = None
        self._arrived = b""
        self._doze = 0.0

    @property
    def online(self) -> bool:
        return self.plugged

    def health(self) -> Health:
        return Health(self.plugged, "" if self.plugged else "head: /dev/nano: no such device")

    def open(self, handler: LinkHandler) -> None:
        self.talker = handler

    def close(self) -> None:
        self.plugged = False

    def write(self, data: bytes) -> None:
        if not self.plugged:
            raise NotConnected("head: /dev/nano: no such device")
        if data.startswith(TIME_REPLY):
            self.replied_at = self.clock.now()
        self._keep(self.device.feed(data, self.clock.now()))

    def set_dtr(self, *, on: bool) -> None:
        self.keeps_dtr = on

    def wake(self) -> None:
        self._doze = 0.0

    def _keep(self, data: bytes) -> None:
        self._arrived = (self._arrived + data)[:KERNEL]

    @property
    def holds_boot_answer(self) -> bool:
        """Whether the answer that shows that the board had no session has arrived, but was not read yet."""
        return NO_SESSION_TIME_REQUESTS * wire.REQUEST_TIME in self._arrived

    def opens(self) -> None:
        assert self.talker is not None
        self._arrived = b""
        self.device.open_port(self.clock.now())
        self.plugged = True
        self.talker.on_connected()

    def passes(self, seconds: float, *, served: bool = True) -> None:
        """Let time pass; the link's thread serves the port now and then, or is held up."""
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            self.clock.advance(self._doze + self.random.uniform(0.003, 0.045) if served else 0.02)
            self._keep(self.device.poll(self.clock.now()) if self.plugged else b"")
            if served and self.plugged and self.talker is not None:
                data, self._arrived = self._arrived, b""
                if data:
                    self.talker.on_data(data)
                self._doze = self.talker.on_poll() or 0.0


class Trial:
    """One head, and what befalls it."""

    def __init__(self, kind: str, seed: int) -> None:
        self.random = Random(f"{kind} {seed}")  # noqa: S311  # it must be repeatable, and guards nothing
        self.clock = ManualClock(100.0)
        self.device = BOARDS[kind]()
        self.line = Line(self.device, self.clock, self.random)
        self.notices: list[DeviceStatus] = []
        boot = 0.0 if "Teensy" in kind else 2.0
        board = ArduinoBoard(self.line, self.clock, boot_delay=boot, report=self.notices.append)
        self.head = ArduinoHead(
            board,
            self.clock,
            pan=ServoAxis(0, radians(-80), radians(80)),
            tilt=ServoAxis(1, radians(-60), radians(20), flip=True),
            speed=radians(SPEED),
            acceleration=radians(400),
        )
        self.told: Counter[str] = Counter()
        self.hidden = False  # a reset that nobody can know of: only a person could say what it did

    def play(self) -> None:
        self.device.power_on(self.clock.now())
        self.head.open()
        self.line.opens()
        self.line.passes(self.random.uniform(0.0, 5.0))
        for _ in range(self.random.randint(1, 5)):
            self.turns()
            self.random.choice((self.resets, self.stalls, self.unplugs, self.reopens))()
            self.line.passes(self.random.choice((0.0, 0.03, 0.5, 4.0)))
        self.turns()
        self.line.passes(3.0)

    def turns(self) -> None:
        """Look here and there, before the head has come to where it looked."""
        for _ in range(self.random.randint(1, 3)):
            if not self.hidden:
                self.head.enable()
            with suppress(DriverError):
                self.head.look(HeadPose(radians(self.random.uniform(-80, 80)), radians(self.random.uniform(-60, 20))))
                self.told["looks"] += 1
            self.line.passes(self.random.uniform(0.0, 1.0))

    def resets(self) -> None:
        self.told["resets"] += 1
        self.device.reset(self.clock.now())
        if self.random.random() < 0.5:
            self.turns()

    def stalls(self) -> None:
        self.told["stalls"] += 1
        seconds = self.random.choice((0.06, 0.3, 2.0, 6.0, 12.0, 25.0))
        if self.random.random() < 0.4:
            begins = self.random.uniform(0.0, seconds)
            self.line.passes(begins, served=False)
            self.device.reset(self.clock.now())
            self.told["resets while it stalls"] += 1
            # By then four time requests may wait unread, as before the end of a session. They count from the last
            # reply, which may be 2.5 s older than the stall.
            self.hidden |= self.clock.now() - self.line.replied_at > SESSION_TIMEOUT - 1.0
            seconds -= begins
        self.line.passes(seconds, served=False)

    def unplugs(self) -> None:
        self.told["reconnects"] += 1
        self.line.plugged = False
        self.line.passes(self.random.choice((0.1, 0.9, 3.0, 8.0)))
        self.device.power_on(self.clock.now())
        self.line.passes(self.random.choice((0.0, 0.5)))
        self.opens()

    def reopens(self) -> None:
        """Only the port is lost, as with a hub that hangs; the board keeps its power."""
        self.told["reconnects"] += 1
        # Only that answer showed the reset, and the probe has opened a new session. The driver sees the same if the hub
        # kept back the bytes of a board that was not reset, until it lost the port.
        self.hidden |= self.line.holds_boot_answer
        self.line.plugged = False
        self.device.close_port(hangs_up=self.random.random() < 0.5 or not self.line.keeps_dtr)
        self.line.passes(self.random.choice((0.1, 0.9, 3.0, 8.0)))
        self.opens()

    def opens(self) -> None:
        """Open the port again; a reset is hidden if the board runs and its session would have expired by now."""
        now = self.clock.now()
        self.line.opens()
        # A board that boots does not answer the first probe, which shows the boot. A board that has booted answers like
        # one whose session has expired: in rosserial no message from the board has its uptime, or the time of day.
        # The driver may count the session from the probe, which is a little earlier than the reply.
        board = self.device
        if board._replied_at == 0.0 and board._boots_until is not None and now >= board._boots_until:  # reset, and runs
            self.hidden |= now - self.line.replied_at > SESSION_TIMEOUT - PROBE_TIMEOUT


def test_head_never_leaps_after_resets_stalls_or_reconnects() -> None:
    told: Counter[str] = Counter()
    widest: dict[str, float] = {}
    leaps = []
    for seed in range(TRIALS // len(BOARDS)):
        for kind in BOARDS:
            trial = Trial(kind, seed)
            trial.play()
            told += trial.told
            widest[kind] = max(widest.get(kind, 0.0), trial.device.max_step)
            if trial.device.max_step > RAMP:
                leaps.append(f"{kind}, seed {seed}: {trial.device.max_step:.0f} degrees")
    assert leaps == []
    assert min(told.values()) > 30


def test_stall_during_boot_does_not_hide_the_boot() -> None:
    """The first probe is not answered, and the board's session would have expired during the stall."""
    trial = Trial("first sketch, Nano", 0)
    trial.device.power_on(trial.clock.now())
    trial.head.open()
    trial.line.opens()
    trial.line.passes(4.0)
    trial.head.look(HeadPose(radians(60), radians(-60)))
    trial.line.passes(2.0)
    trial.line.plugged = False
    trial.device.close_port(hangs_up=True)
    trial.line.passes(8.0)
    trial.line.opens()
    trial.line.passes(0.01)
    trial.line.passes(6.0, served=False)
    trial.line.passes(2.0)
    trial.head.enable()
    trial.head.look(HeadPose(radians(-60), radians(-60)))
    trial.line.passes(2.0)
    assert trial.device.max_step <= RAMP
