"""How far the servos of a Rodney head leap, by sketch and event: by what the driver sends, and by the sketch itself.

The driver, its link and the virtual board on simulated time. What the driver sends is to be a ramp whatever happens.
What a sketch does as it starts no driver can prevent; DTR that stays on prevents that it starts.
"""

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from math import degrees, radians
from pathlib import Path

import pytest

from drivers.api import DeviceStatus, HeadPose
from drivers.arduino.board import ArduinoBoard
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.virtual import (
    EARLY_SKETCH_ANGLES,
    ENCODER_SKETCH_ANGLES,
    FIRST_SKETCH_ANGLES,
    UNSENT_SKETCH_ANGLES,
    VirtualRodney,
)
from drivers.head.angle_store import ServoAngleStore
from drivers.head.axis import ServoAxis
from drivers.sim.timeline import Timeline
from tests.drivers.cranked import HandWire
from tests.drivers.test_arduino_campaign import RAMP, SPEED

PAN, TILT = 45, -40
"""Where the head looks before each event, in degrees: 45 and 10 off where the first sketch starts its servos."""


@dataclass(frozen=True)
class Sketch:
    """A sketch on a board, and the `start` of both servos in the robot file; None for a file that says nothing."""

    board: Callable[[], VirtualRodney]
    start: tuple[int | None, int | None] = (None, None)


SKETCHES: Mapping[str, Sketch] = {
    "Parts 01 to 04, Nano": Sketch(
        lambda: VirtualRodney(logs_angles=True, start_angles=FIRST_SKETCH_ANGLES, boot_delay=1.0)
    ),
    "with encoders, Nano": Sketch(
        lambda: VirtualRodney(logs_angles=True, tacho=True, start_angles=ENCODER_SKETCH_ANGLES, boot_delay=1.0)
    ),
    "with encoders, Teensy": Sketch(lambda: VirtualRodney(tacho=True, boot_delay=0.4, native_usb=True)),
    "before Part 01, Nano": Sketch(
        lambda: VirtualRodney(logs_angles=True, start_angles=EARLY_SKETCH_ANGLES, boot_delay=1.0), (90, 40)
    ),
    "the oldest, Nano": Sketch(
        lambda: VirtualRodney(logs_angles=True, start_angles=UNSENT_SKETCH_ANGLES, boot_delay=1.0), (92, 92)
    ),
}


class Scene:
    """A head on a board, programs that come and go, and the time."""

    def __init__(self, sketch: Sketch, folder: Path) -> None:
        self.timeline = Timeline()
        self.sketch, self.board = sketch, sketch.board()
        self.notices: list[DeviceStatus] = []
        self.memories: list[ServoAngleStore] = []
        self.wire = HandWire(self.board, self.timeline)
        self.port, self.folder = folder / "ttyUSB0", folder
        self.port.touch()
        self.board.power_on(0.0)
        self.run(3.0)
        self.head = self.program()
        self.look(PAN, TILT)

    def program(self) -> ArduinoHead:
        """Start a program that moves the head."""
        clock, (pan, tilt) = self.timeline.clock, self.sketch.start
        self.link = link = self.wire.link("head", report=self.notices.append)
        remembered = ServoAngleStore(self.folder, str(self.port))
        self.memories.append(remembered)
        boot = 0.0 if self.sketch is SKETCHES["with encoders, Teensy"] else 2.0
        head = ArduinoHead(
            ArduinoBoard(link, clock, boot_delay=boot, report=self.notices.append, angle_store=remembered),
            clock,
            pan=ServoAxis(0, radians(-80), radians(80), start=pan),
            tilt=ServoAxis(1, radians(-80), radians(20), flip=True, start=tilt),
            speed=radians(SPEED),
            acceleration=radians(400),
        )
        head.open()
        self.run(6.0)
        return head

    def run(self, seconds: float) -> None:
        self.timeline.run_until(self.timeline.clock.now() + seconds)

    def close(self) -> None:
        self.head.close()
        for each in self.memories:
            each.close()

    def look(self, pan: float, tilt: float) -> None:
        self.head.enable()
        self.head.look(HeadPose(radians(pan), radians(tilt)))
        self.run(3.0)
        pose = self.head.pose().value
        assert pose is not None
        assert (degrees(pose.pan), degrees(pose.tilt)) == pytest.approx((pan, tilt), abs=1.01)

    # --- events ---------------------------------------------------------------------------------------------------

    def nothing(self) -> None:
        """Have no event."""

    def reset(self) -> None:
        self.board.reset(self.timeline.clock.now())

    def reset_as_it_turns(self) -> None:
        self.head.look(HeadPose(radians(-PAN), radians(10)))
        self.run(0.3)
        self.reset()

    def lose_power(self) -> None:
        """Have the supply fail for a moment, with the port there all the while."""
        self.board.power_on(self.timeline.clock.now())

    def replug(self) -> None:
        self.wire.unplug()
        self.run(1.0)
        self.wire.plug_in()

    def lose_port(self) -> None:
        """Lose the port of a board that has power from elsewhere."""
        self.wire.unplug()
        self.run(1.0)
        self.wire.come_back()

    def end_and_begin(self) -> None:
        self.head.close()
        self.run(5.0)
        self.head = self.program()

    def killed(self) -> None:
        """Have the program end as by `kill -9` while it turns the head: the kernel closes the port."""
        self.head.look(HeadPose(radians(-PAN), radians(10)))
        self.run(0.3)
        self.kill()
        self.run(2.0)
        self.head = self.program()

    def killed_and_another_opens(self) -> None:
        """The same, and a program that hangs up, such as a serial monitor, has had the port before the next one."""
        self.kill()
        self.board.open_port(self.timeline.clock.now())
        self.board.close_port(hangs_up=True)
        self.run(2.0)
        self.head = self.program()

    def kill(self) -> None:
        self.link._loop.is_alive = False  # type: ignore[misc]
        assert self.wire.holder is not None
        self.wire.holder.close()


EVENTS: Mapping[str, Callable[[Scene], None]] = {
    "nothing": Scene.nothing,
    "reset button": Scene.reset,
    "reset while it turns": Scene.reset_as_it_turns,
    "power lost for a moment": Scene.lose_power,
    "plug pulled and put in": Scene.replug,
    "port lost, power kept": Scene.lose_port,
    "next program": Scene.end_and_begin,
    "killed, next program": Scene.killed,
    "killed, a serial monitor, next program": Scene.killed_and_another_opens,
}

NATIVE_USB = "with encoders, Teensy"
NO_RESET = {
    "nothing": SKETCHES.keys(),
    "next program": SKETCHES.keys(),
    "killed, next program": SKETCHES.keys(),
    "port lost, power kept": {NATIVE_USB},
    "killed, a serial monitor, next program": {NATIVE_USB},
}
"""The events at which the boards of these sketches do not start anew."""


def played(sketch: Sketch, event: str, folder: Path) -> tuple[float, float]:
    """Return the widest steps (degrees) since an event: of the driver, and of the sketch as it started."""
    with closing(Scene(sketch, folder)) as scene:
        assert scene.board.max_step <= RAMP  # the first program after the board was plugged in
        assert scene.board.max_start_step == 0.0
        scene.board.max_step = 0.0
        EVENTS[event](scene)
        scene.run(8.0)
        scene.look(-20, 5)
        scene.look(PAN, TILT)
    return scene.board.max_step, scene.board.max_start_step


@pytest.mark.parametrize("event", list(EVENTS))
@pytest.mark.parametrize("name", list(SKETCHES))
def test_no_event_makes_the_driver_leap_and_only_a_boot_leaps(
    name: str, event: str, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    sent, start = played(SKETCHES[name], event, tmp_path)
    record_property("figure", f"{name} | {event}: driver {sent:.0f}, sketch {start:.0f} degrees")
    assert sent <= RAMP
    assert (start > 0.0) is (name not in NO_RESET.get(event, ()))


@pytest.mark.parametrize(("name", "leap"), [("before Part 01, Nano", 80.0), ("the oldest, Nano", 27.3)])
def test_start_angle_mismatch_leaps_unless_the_robot_file_sets_start(name: str, leap: float, tmp_path: Path) -> None:
    with closing(Scene(Sketch(SKETCHES[name].board), tmp_path)) as scene:
        assert scene.board.max_step == pytest.approx(leap, abs=2.0)


def test_running_board_with_unknown_angles_stays_until_commanded(
    tmp_path: Path,
) -> None:
    with closing(Scene(SKETCHES[NATIVE_USB], tmp_path)) as scene:
        scene.kill()
        for kept in tmp_path.glob("servos*.json"):
            kept.unlink()
        scene.board.commands.clear()
        scene.head = scene.program()
        scene.run(10.0)
    assert scene.board.commands == []
    assert any("unknown servo angles" in notice.message for notice in scene.notices)


def place_unknown(scene: Scene) -> None:
    """Start a program that finds a running board, and no file that says where its servos stand."""
    scene.kill()
    scene.notices.clear()
    for kept in scene.folder.glob("servos*.json"):
        kept.unlink()
    scene.head = scene.program()


def warnings(scene: Scene) -> int:
    return sum("unknown servo angles" in notice.message for notice in scene.notices)


@pytest.mark.parametrize("killed", [False, True])
@pytest.mark.parametrize(("pan", "tilt"), [(None, None), (30, None), (None, 10), (30, 10)])
def test_assumed_angle_is_not_stored_as_known(pan: int | None, tilt: int | None, killed: bool, tmp_path: Path) -> None:
    with closing(Scene(SKETCHES[NATIVE_USB], tmp_path)) as scene:
        place_unknown(scene)
        assert warnings(scene) == 1
        known = pan is not None or tilt is not None
        here = scene.head.pose().value
        assert here is not None
        aim = HeadPose(
            here.pan if pan is None else radians(pan),
            here.tilt if tilt is None else radians(tilt),
        )
        scene.head.enable()
        if known:  # a goal is sent to both servos, also where it equals the guess
            scene.head.look(aim)
        scene.run(3.0)
        scene.kill() if killed else scene.head.close()
        scene.board.commands.clear()
        scene.head = scene.program()
        assert warnings(scene) == (1 if known else 2)
        if not known:
            assert scene.board.commands == []


def test_stored_angle_of_other_servos_is_ignored(tmp_path: Path) -> None:
    with closing(Scene(SKETCHES[NATIVE_USB], tmp_path)) as scene:
        scene.head.close()
        memory = ServoAngleStore(tmp_path, str(scene.port))
        memory.save({0: 120})
        memory.close()
        scene.notices.clear()
        scene.board.commands.clear()
        scene.head = scene.program()
        assert warnings(scene) == 1
        assert scene.board.commands == []
