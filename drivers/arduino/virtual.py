"""Virtual Rodney head at wire level: the board's side of rosserial, and four hobby servos."""

from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from threading import Lock
from typing import Final

from drivers.api import HeadPose
from drivers.arduino import wire
from drivers.arduino.declared import ArduinoKeys, SecondPanTiltKeys
from drivers.arduino.wire import HEADER, RosserialFrame
from drivers.head.axis import ENCODER_SKETCH_STARTS, FIRST_SKETCH_STARTS, make_servo_axis
from drivers.head.keys import TwoServoKeys
from drivers.sim.context import SimContext
from drivers.sim.servo import SERVO_SPEED, Shaft
from drivers.virtual.device import VirtualDevice
from drivers.virtual.guardian import VirtualServos, make_virtual_servos

# Receiver of a rosserial board: byte by byte, with the checks and the timeout of its library.

FRAME_TIMEOUT = 0.02
"""Seconds after its first byte within which a frame must be complete."""


class RosserialReceiver:
    """Receiver of a rosserial board; drops frames of more than ``buffer`` bytes, and those with wrong checksums."""

    def __init__(self, buffer: int) -> None:
        self._buffer = buffer
        self._frame = bytearray()
        self._began = 0.0

    def feed(self, data: bytes, now: float) -> Iterator[RosserialFrame | None]:
        """Yield the frames that are complete at time ``now``, and None for each invalid header."""
        if self._frame and now - self._began > FRAME_TIMEOUT:
            self._frame.clear()
        for byte in data:
            frame = self._frame
            if not frame:
                self._began = now
            frame.append(byte)
            size = len(frame)
            if size == 1 and byte != HEADER[0]:
                frame.clear()
            elif size == 2 and byte != HEADER[1]:
                frame.clear()
                yield None
            elif size == 5 and (sum(frame[2:5]) % 256) != 255:
                frame.clear()
            elif size > 7 and size == 8 + int.from_bytes(frame[2:4], "little"):
                topic, body = int.from_bytes(frame[5:7], "little"), bytes(frame[7:-1])
                sound = sum(frame[5:]) % 256 == 255 and len(body) <= self._buffer
                frame.clear()
                if sound:
                    yield RosserialFrame(topic, body)


ATTACHED_ANGLE = 92.7
"""Angle in degrees of a servo that is attached but has no setpoint: it gets pulses of 1500 microseconds."""

FIRST_SKETCH_ANGLES = (*FIRST_SKETCH_STARTS[:2], ATTACHED_ANGLE, ATTACHED_ANGLE)
"""Start angles of the first sketch (Parts 01 to 04): it moves servos 0 and 1 to 90 and 120 degrees."""

ENCODER_SKETCH_ANGLES = (*ENCODER_SKETCH_STARTS[:2], ATTACHED_ANGLE, ATTACHED_ANGLE)
"""Start angles of the sketches with encoders for a Nano, which move only servos 0 and 1; the Teensy's moves all."""

EARLY_SKETCH_ANGLES = (90, 40, ATTACHED_ANGLE, ATTACHED_ANGLE)
"""Start angles of a sketch on the project's pages before Part 01."""

UNSENT_SKETCH_ANGLES = (ATTACHED_ANGLE, ATTACHED_ANGLE, ATTACHED_ANGLE, ATTACHED_ANGLE)
"""Start angles of the oldest sketches: at boot they attach the servos, but give them no setpoints."""

TIME_REQUEST_INTERVAL = 2.5  # seconds between two time requests
SESSION_TIMEOUT = 11.0  # seconds without a reply after which the session expires
TACHO_INTERVAL = 0.05
MIN_PULSE_MICROSECONDS, MAX_PULSE_MICROSECONDS = (
    544,
    2400,
)  # pulses of the Servo library for 0 and 180 degrees


class SketchState(Enum):
    """State of a sketch. UNCONFIGURED: it runs without a session with a computer, and publishes nothing."""

    BOOTING, UNCONFIGURED, CONFIGURED = range(3)


class SketchEvent(Enum):
    """Event of a sketch. NEGOTIATE: it announces its topics. STOP: the computer stops it, or sends no more replies."""

    RESET, BOOT, NEGOTIATE, STOP = range(4)


TRANSITIONS: Final = {
    **{(state, SketchEvent.RESET): SketchState.BOOTING for state in SketchState},
    (SketchState.BOOTING, SketchEvent.BOOT): SketchState.UNCONFIGURED,
    (SketchState.UNCONFIGURED, SketchEvent.NEGOTIATE): SketchState.CONFIGURED,
    (SketchState.CONFIGURED, SketchEvent.NEGOTIATE): SketchState.CONFIGURED,
    (SketchState.UNCONFIGURED, SketchEvent.STOP): SketchState.UNCONFIGURED,
    (SketchState.CONFIGURED, SketchEvent.STOP): SketchState.UNCONFIGURED,
}


class VirtualRodney:
    """Virtual board with a Rodney sketch: a ``drivers.virtual.terminal.WireDevice``.

    With ``tacho`` the sketch reports encoders, as that for a Teensy does. The board neither receives nor sends for
    ``boot_delay`` seconds after its first poll, and after each ``reset``. From then on it obeys setpoints, with or
    without a session. ``start_angles`` are those of the sketch, such as ``FIRST_SKETCH_ANGLES``. With ``logs_angles``
    it logs each setpoint, as the sketches for a Nano do. A Nano is reset when DTR rises as its port is opened, unless
    DTR stayed on after the last close; a board with ``native_usb`` is not. Without power and during the boot the servos
    stay. ``servo_topic`` may be replaced to simulate other message definitions. ``commands`` lists the received (index,
    angle) pairs. ``max_step`` is the widest step in degrees from a servo's previous setpoint, ``max_start_step`` the
    widest step of the sketch itself at boot. ``wheels`` are the turn rates that the encoders report.
    """

    def __init__(
        self,
        *,
        baud: int = 57600,
        boot_delay: float = 0.0,
        tacho: bool = False,
        buffer: int = 512,
        servo_topic: wire.RosserialTopic = wire.SERVO_TOPIC,
        start_angles: Sequence[float] = ENCODER_SKETCH_STARTS,
        logs_angles: bool = False,
        native_usb: bool = False,
    ) -> None:
        self.baud = baud
        self.commands: list[tuple[int, int]] = []
        self.max_step = self.max_start_step = 0.0
        self.wheels = wire.Tacho(0.0, 0.0)
        self._boot_delay = boot_delay
        self._buffer = buffer
        self._servo_info = wire.TopicInfo(wire.FIRST_USER_TOPIC, servo_topic, buffer)
        self._tacho_info = wire.TopicInfo(wire.FIRST_USER_TOPIC + 25, wire.TACHO_TOPIC, buffer) if tacho else None
        self._start_angles, self._logs_angles, self._native_usb = start_angles, logs_angles, native_usb
        self._shafts = [Shaft(start, start, SERVO_SPEED) for start in start_angles]
        self._lock = Lock()  # the simulated world reads the shafts from its own thread
        self._boots_until: float | None = None
        self._state = SketchState.BOOTING
        self._dtr = False
        self._restart()

    def _restart(self) -> None:
        """Reset the memory of the sketch."""
        self._receiver = RosserialReceiver(self._buffer)
        self._state = TRANSITIONS[self._state, SketchEvent.RESET]
        self._time_requested_at = self._replied_at = self._tacho_sent_at = 0.0
        self._logs: list[wire.RosserialLog] = []

    def angle(self, index: int, now: float) -> float:
        """Return the angle of servo ``index`` at time ``now``, in degrees."""
        with self._lock:
            return self._shafts[index].advance(now)

    def log(self, line: wire.RosserialLog) -> None:
        """Queue a log line; it is sent as soon as the board has a session with the computer."""
        with self._lock:
            self._logs.append(line)

    def reset(self, now: float) -> None:
        """Press the reset button at time ``now``."""
        with self._lock:
            self._restart()
            self._boots_until = now + self._boot_delay

    def open_port(self, now: float) -> None:
        """Open the port on the computer at time ``now``, which raises DTR."""
        rises, self._dtr = not self._dtr, True
        if rises and not self._native_usb:
            self.reset(now)

    def close_port(self, *, hangs_up: bool) -> None:
        """Close the port on the computer: DTR falls if ``hangs_up``, as on Linux unless HUPCL is off."""
        self._dtr = self._dtr and not hangs_up

    def power_on(self, now: float) -> None:
        """Plug the board in at time ``now``; it has its power from the plug."""
        self._dtr = False
        self.reset(now)

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle bytes from the computer; return the replies."""
        with self._lock:
            if not self._run_sketch(now):
                return b""
            self._expire_session(now)
            return b"".join(self._handle_frame(frame, now) for frame in self._receiver.feed(data, now))

    def poll(self, now: float) -> bytes:
        """Return the messages that are due."""
        with self._lock:
            if not self._run_sketch(now):
                return b""
            self._expire_session(now)
            if self._state is not SketchState.CONFIGURED:
                return b""
            data = b"".join(wire.RosserialFrame(wire.LOG, line.pack()).pack() for line in self._logs)
            self._logs.clear()
            if now - self._time_requested_at >= TIME_REQUEST_INTERVAL:
                self._time_requested_at = now
                data += wire.REQUEST_TIME
            if self._tacho_info and now - self._tacho_sent_at >= TACHO_INTERVAL:
                self._tacho_sent_at = now
                data += wire.RosserialFrame(self._tacho_info.id, self.wheels.pack()).pack()
            return data

    def _expire_session(self, now: float) -> None:
        """End the session if the computer has not replied to time requests for too long."""
        if now - self._replied_at > SESSION_TIMEOUT:
            self._state = TRANSITIONS[self._state, SketchEvent.STOP]

    def _run_sketch(self, now: float) -> bool:
        """Return whether the sketch runs; at the end of the boot, move the servos to their start angles."""
        if self._boots_until is None:
            self._boots_until = now + self._boot_delay
        if self._state is SketchState.BOOTING and now >= self._boots_until:
            self._state = TRANSITIONS[self._state, SketchEvent.BOOT]
            for shaft, start in zip(self._shafts, self._start_angles, strict=True):
                self.max_start_step = max(self.max_start_step, abs(start - shaft.advance(now)))
                shaft.goal = start
        return self._state is not SketchState.BOOTING

    def _handle_frame(self, frame: wire.RosserialFrame | None, now: float) -> bytes:
        if frame is None:
            return b"" if self._state is SketchState.CONFIGURED else wire.REQUEST_TIME
        if frame.topic == wire.PUBLISHER:
            return self._negotiate(now)
        if frame.topic == wire.TIME:
            self._replied_at = now
        elif frame.topic == wire.STOP:
            self._state = TRANSITIONS[self._state, SketchEvent.STOP]
        elif frame.topic == self._servo_info.id and len(frame.data) >= 3:
            command = wire.ServoAngle.unpack(frame.data)
            self._turn_servo(command, now)
            if self._logs_angles:
                return wire.RosserialFrame(wire.LOG, wire.RosserialLog(0, f"Servo {command.index} ").pack()).pack()
        return b""

    def _negotiate(self, now: float) -> bytes:
        """Request the time, then announce the topics: publishers first, then subscribers."""
        self._state = TRANSITIONS[self._state, SketchEvent.NEGOTIATE]
        self._time_requested_at = self._replied_at = now
        published = wire.RosserialFrame(wire.PUBLISHER, self._tacho_info.pack()).pack() if self._tacho_info else b""
        return wire.REQUEST_TIME + published + wire.RosserialFrame(wire.SUBSCRIBER, self._servo_info.pack()).pack()

    def _turn_servo(self, command: wire.ServoAngle, now: float) -> None:
        """Execute a setpoint as the sketch and the Servo library do, whatever its value."""
        self.commands.append((command.index, command.angle))
        if command.index >= len(self._shafts):
            self._logs.append(wire.RosserialLog(0, f"no servo {command.index}"))
            return
        shaft = self._shafts[command.index]
        shaft.advance(now)
        before = shaft.goal
        if command.angle < MIN_PULSE_MICROSECONDS:
            shaft.goal = float(min(command.angle, 180))
        else:
            pulse = min(command.angle, MAX_PULSE_MICROSECONDS)
            shaft.goal = 180 * (pulse - MIN_PULSE_MICROSECONDS) / (MAX_PULSE_MICROSECONDS - MIN_PULSE_MICROSECONDS)
        self.max_step = max(self.max_step, abs(shaft.goal - before))


def make(keys: ArduinoKeys, context: SimContext) -> VirtualDevice:  # noqa: ARG001
    """Return a virtual Rodney head; its state is the angles of four servos in degrees."""
    pan, tilt = make_servo_axis(keys.pan), make_servo_axis(keys.tilt)
    if keys.protocol == "lines":
        return make_virtual_servos(
            VirtualServos((pan.start_degrees, tilt.start_degrees), baud=keys.baud), pan, tilt, "nano"
        )
    own = {axis.index: axis.start for axis in (pan, tilt) if axis.start is not None}
    device = VirtualRodney(
        baud=keys.baud,
        logs_angles=True,
        start_angles=[own.get(index, at) for index, at in enumerate(FIRST_SKETCH_ANGLES)],
    )
    return VirtualDevice(
        device,
        "nano",
        head_pose=_make_head_pose(device, keys),
        state=lambda now: [device.angle(index, now) for index in range(4)],
    )


def make_second(keys: SecondPanTiltKeys, context: SimContext) -> VirtualDevice:
    """Return a second pan/tilt device on the board of a virtual Rodney head."""
    return VirtualDevice(None, head_pose=_make_head_pose(context.parts["head"].device, keys))


def _make_head_pose(device: VirtualRodney, keys: TwoServoKeys) -> Callable[[float], HeadPose]:
    pan, tilt = make_servo_axis(keys.pan), make_servo_axis(keys.tilt)

    def looks(time: float) -> HeadPose:
        return HeadPose(pan.to_radians(device.angle(pan.index, time)), tilt.to_radians(device.angle(tilt.index, time)))

    return looks
