"""What twins have beyond the contracts: likeness to the real drivers, faults by hand, and the same for a seed."""

import os
import subprocess
import sys
from math import radians
from typing import Any

import numpy as np
import pytest

from drivers.api import (
    COMMAND_TIMEOUT,
    ZERO_VELOCITY,
    DeviceStatus,
    HeadPose,
    Health,
    Image,
    Pose2D,
    Quality,
    Sides,
    Velocity,
)
from drivers.arduino.board import ArduinoBoard
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.virtual import VirtualRodney
from drivers.base.twin import BaseTwin
from drivers.camera.twin import CameraTwin
from drivers.clock import ManualClock
from drivers.errors import BadRequest, NotConnected
from drivers.head.axis import ServoAxis
from drivers.head.twin import ServoHeadTwin
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.odometry import battery_percent
from drivers.kobuki.twin import KobukiTwinOdometry
from drivers.kobuki.virtual import VirtualKobuki
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin
from drivers.sim.base_body import BaseBody
from drivers.sim.plug import SimulatedPlug
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from drivers.transport.link import LinkHandler, SerialLink
from drivers.virtual.terminal import WireDevice
from drivers.voice.twin import VoiceTwin

PAN = ServoAxis(0, radians(-80), radians(80), start=90)
TILT = ServoAxis(1, radians(-60), radians(20), flip=True, start=120, trim=radians(3))


class DirectLink(SerialLink):
    """A link without port and thread: a virtual device at its other end, on a clock that is advanced by hand."""

    def __init__(self, device: WireDevice, clock: ManualClock) -> None:
        super().__init__("device", "/dev/device", device.baud)
        self.device = device
        self.clock = clock
        self.talker: LinkHandler | None = None
        self._answer = b""

    @property
    def online(self) -> bool:
        return self.talker is not None

    def health(self) -> Health:
        return Health(self.online)

    def open(self, handler: LinkHandler) -> None:
        self.talker = handler
        handler.on_connected()

    def close(self) -> None:
        self.talker = None

    def set_dtr(self, *, on: bool) -> None:
        """Do nothing: this wire has no such line."""

    def write(self, data: bytes) -> None:
        self._answer += self.device.feed(data, self.clock.now())

    def step(self) -> None:
        """Bring across what the device has to say by now."""
        said, self._answer = self._answer + self.device.poll(self.clock.now()), b""
        if self.talker is not None:
            if said:
                self.talker.on_data(said)
            self.talker.on_poll()


def kinds(notices: list[DeviceStatus]) -> list[str]:
    return [notice.kind for notice in notices]


# --- the plug ---------------------------------------------------------------------------------------------------------


def test_plug_reports_only_unplanned_changes() -> None:
    notices: list[DeviceStatus] = []
    calls: list[str] = []
    plug = SimulatedPlug(
        "arm", notices.append, on_online=lambda: calls.append("back"), on_offline=lambda: calls.append("gone")
    )
    plug.unplug()
    plug.open()
    assert (plug.online, kinds(notices), calls) == (False, [], [])
    plug.plug_in()
    plug.plug_in()
    assert (plug.online, kinds(notices), calls) == (True, ["online"], ["back"])
    plug.unplug()
    plug.unplug()
    assert (plug.online, kinds(notices), calls) == (False, ["online", "offline"], ["back", "gone"])
    plug.plug_in()
    assert plug.health({"frames": 3}).counters == {"connections": 2, "frames": 3}
    plug.close()
    plug.close()
    assert (plug.online, kinds(notices), plug.connections) == (False, ["online", "offline", "online"], 0)
    with pytest.raises(NotConnected, match="arm: not opened yet"):
        plug.check_online()


def test_plug_survives_a_failing_callback(caplog: pytest.LogCaptureFixture) -> None:
    def fail(notice: DeviceStatus) -> None:
        raise RuntimeError(notice.message)

    plug = SimulatedPlug("arm", fail)
    plug.open()
    plug.unplug()
    assert not plug.online
    assert "a callback failed" in caplog.text


# --- likeness ---------------------------------------------------------------------------------------------------------


def test_base_twin_drives_like_the_real_driver() -> None:
    clock = ManualClock()
    link = DirectLink(VirtualKobuki(wheels=SimulatedWheels(dead_time=0.1, slip=0.05)), clock)
    real, twin = (
        kobuki_base(link, clock),
        BaseTwin(clock, odometry=KobukiTwinOdometry(), body=BaseBody(wheels=SimulatedWheels(dead_time=0.1, slip=0.05))),
    )
    real.open()
    link.step()
    twin.open()
    course = [(0.0, 0.0), (0.6, 0.3), (0.2, -1.5), (-0.3, 0.0), (0.0, 3.0), (0.1, 0.1), (0.3, 0.0)]
    for step in range(1, 701):
        clock.advance_to(step * 0.02)
        link.step()
        twin.step()
        if step % 5 == 0 and step < 600:
            velocity = Velocity(*course[step // 100])
            assert twin.drive(velocity) == real.drive(velocity)
        mine, its = twin.state().value, real.state().value
        assert mine is not None
        assert its is not None
        assert (mine.pose.x, mine.pose.y) == pytest.approx((its.pose.x, its.pose.y), abs=0.005)
        assert mine.pose.heading == pytest.approx(its.pose.heading, abs=0.02)
        assert (mine.velocity.linear, mine.velocity.angular) == pytest.approx(
            (its.velocity.linear, its.velocity.angular), abs=0.02
        )
    assert twin.true_pose(clock.now()).heading == pytest.approx(
        link.device.pose(clock.now()).heading if isinstance(link.device, VirtualKobuki) else None, abs=0.02
    )


def test_head_twin_turns_like_the_real_driver() -> None:
    clock, rodney = ManualClock(), VirtualRodney(tacho=True)
    link = DirectLink(rodney, clock)
    real = ArduinoHead(ArduinoBoard(link, clock, boot_delay=0.0), clock, pan=PAN, tilt=TILT, speed=2.0)
    twin = ServoHeadTwin(clock, pan=PAN, tilt=TILT, speed=2.0)
    real.open()
    twin.open()
    course = [(0.5, 0.1), (-1.0, -0.5), (2.0, 2.0), (0.0, 0.0), (0.31, 0.07)]
    for step in range(1, 501):
        clock.advance_to(step * 0.02)
        link.step()
        twin.step()
        if step % 100 == 1 and step > 1:
            goal = HeadPose(*course[step // 100])
            assert twin.look(goal) == real.look(goal)
        if step % 100 == 40:
            twin.stop()
            real.stop()
        if step > 50:  # the real one has first to meet its board
            mine, its, truth = twin.pose().value, real.pose().value, twin.true_pose(clock.now())
            assert mine is not None
            assert its is not None
            # The real one waits now and then until its board has shown that it is still there.
            assert (mine.pan, mine.tilt) == pytest.approx((its.pan, its.tilt), abs=radians(5.01))
            servos = (
                PAN.to_radians(rodney.angle(0, clock.now())),
                TILT.to_radians(rodney.angle(1, clock.now())),
            )
            assert (truth.pan, truth.tilt) == pytest.approx(servos, abs=radians(5.01))
        if step % 100 == 0:
            assert twin.pose().value == real.pose().value


# --- the base ---------------------------------------------------------------------------------------------------------


class BaseBench:
    """A base's twin on a timeline."""

    def __init__(self, **options: Any) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.notices: list[DeviceStatus] = []
        self.base = BaseTwin(self.clock, report=self.notices.append, **options)
        self.base.open()
        self.timeline.call_every(self.base.STEP_INTERVAL, self.base.step)

    def run(self, seconds: float, velocity: Velocity | None = None) -> None:
        """Let time pass, asking for ``velocity`` every 0.1 s."""
        for _ in range(round(seconds / 0.1)):
            if velocity is not None:
                self.base.drive(velocity)
            self.timeline.run_until(self.clock.now() + 0.1)

    @property
    def pose(self) -> Pose2D:
        state = self.base.state().value
        assert state is not None
        return state.pose


def test_on_slipping_wheels_odometry_believes_to_have_gone_further_but_the_gyro_knows_the_turn() -> None:
    bench = BaseBench(body=BaseBody(wheels=SimulatedWheels(slip=0.1)))
    bench.run(4.0, Velocity(0.4, 0.4))
    truth = bench.base.true_pose(bench.clock.now())
    assert bench.pose.heading == pytest.approx(truth.heading, abs=0.001)
    assert (bench.pose.x * 0.9, bench.pose.y * 0.9) == pytest.approx((truth.x, truth.y), abs=0.01)


def test_a_noisy_gyro_leads_astray_and_no_other_does() -> None:
    noisy, good = BaseBench(gyro_noise=0.5, seed=4), BaseBench()
    for bench in (noisy, good):
        bench.run(10.0)
    assert good.pose.heading == 0.0
    assert 0.005 < abs(noisy.pose.heading) < 1.0
    assert noisy.base.true_pose(noisy.clock.now()).heading == 0.0


def test_partly_lost_reports_do_not_stop_the_base() -> None:
    bench = BaseBench(dropouts=0.3, seed=1)
    bench.run(20.0, Velocity(0.2, 0.0))
    assert bench.base.health().counters["frames"] == pytest.approx(700, abs=70)
    assert bench.base.health().online
    assert bench.pose.x == pytest.approx(3.95, abs=0.1)
    assert kinds(bench.notices) == ["online"]


def test_base_without_any_report_is_offline_and_stands() -> None:
    bench = BaseBench(dropouts=1.0)
    bench.base.drive(Velocity(0.3, 0.0))
    bench.run(0.5)
    assert kinds(bench.notices) == ["online", "offline"]
    health = bench.base.health()
    assert (health.online, health.detail, health.hint != "") == (False, bench.notices[-1].message, True)
    with pytest.raises(NotConnected, match="silent"):
        bench.base.drive(Velocity(0.3, 0.0))
    at_rest = bench.base.true_pose(bench.clock.now())
    bench.run(1.0)
    assert bench.base.true_pose(bench.clock.now()) == at_rest
    assert bench.base.state().quality is Quality.STALE


def test_silent_base_stops_before_its_command_expires() -> None:
    bench = BaseBench(dropouts=1.0)
    for _ in range(2):
        bench.timeline.run_until(bench.clock.now() + 0.1)
        bench.base.drive(Velocity(0.3, 0.0))
    bench.timeline.run_until(0.24)
    assert bench.base.body.velocity.linear > 0.0
    bench.timeline.run_until(0.2 + COMMAND_TIMEOUT)
    assert bench.base.body.velocity == ZERO_VELOCITY


def test_rarely_reporting_base_goes_online_and_offline() -> None:
    bench = BaseBench(dropouts=0.95, seed=2)
    bench.run(20.0)
    told = kinds(bench.notices)
    assert len(told) > 6
    assert told == ["online", "offline"] * (len(told) // 2) + ["online"] * (len(told) % 2)


def test_drained_battery_keeps_its_charge() -> None:
    bench = BaseBench()
    bench.base.drain(12.0)
    state = bench.base.state().value
    assert state is not None
    assert state.battery_percent == 12.0
    assert battery_percent(state.battery_voltage) == pytest.approx(12.0)
    with pytest.raises(ValueError, match="120"):
        bench.base.drain(120.0)


def test_buttons_are_reported_while_pressed() -> None:
    bench = BaseBench()
    bench.base.press(buttons=frozenset({1}))
    bench.run(0.1)
    state = bench.base.state().value
    assert state is not None
    assert state.buttons == {1}
    bench.base.press()
    bench.run(0.1)
    state = bench.base.state().value
    assert state is not None
    assert state.buttons == frozenset()


def test_base_at_an_edge_reports_each_cliff_once() -> None:
    bench = BaseBench()
    bench.base.press(cliff=Sides(left=True))
    bench.run(1.0)
    bench.base.press(cliff=Sides(left=True, right=True))
    bench.run(1.0)
    assert [notice.message for notice in bench.notices[1:]] == [
        "cliff left: it does not drive forward",
        "cliff right: it does not drive forward",
    ]


def test_unplugged_base_rolls_to_a_stop_and_drops_its_command() -> None:
    bench = BaseBench()
    bench.run(2.0, Velocity(0.4, 0.0))
    bench.base.plug.unplug()
    bench.run(COMMAND_TIMEOUT + 1.0)
    body = bench.base.body
    assert body.velocity == ZERO_VELOCITY
    rolled = bench.base.true_pose(bench.clock.now()).x
    assert 0.7 < rolled < 1.0
    bench.base.plug.plug_in()
    bench.run(1.0)
    assert bench.base.true_pose(bench.clock.now()).x == rolled
    # What it rolled while nobody listened, odometry cannot know.
    assert bench.pose.x < rolled - 0.1


def test_brief_unplug_ends_the_drive() -> None:
    bench = BaseBench()
    bench.run(2.0, Velocity(0.4, 0.0))
    bench.base.plug.unplug()
    bench.base.plug.plug_in()
    bench.run(0.1)
    assert bench.base.body.velocity.linear < 0.3


@pytest.mark.parametrize("wrong", [{"dropouts": 1.5}, {"dropouts": -0.1}, {"gyro_noise": -1.0}, {"max_linear": 0.0}])
def test_invalid_base_twin_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        BaseTwin(ManualClock(), **wrong)  # type: ignore[arg-type]  # the values are floats, whatever their names


# --- head, joints, voice ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [0.0, float("inf"), float("nan")])
def test_a_head_without_a_sensible_speed_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="is not positive"):
        ServoHeadTwin(ManualClock(), pan=PAN, tilt=TILT, speed=speed)


def test_an_unplugged_heads_servos_finish_their_last_degree_and_hold() -> None:
    timeline = Timeline()
    head = ServoHeadTwin(timeline.clock, pan=PAN, tilt=TILT, speed=6.0)
    head.open()
    timeline.call_every(head.STEP_INTERVAL, head.step)
    timeline.run_until(1.0)
    head.look(HeadPose(1.0, 0.0))
    timeline.run_until(1.1)
    head.plug.unplug()
    sent = head.pose().value
    timeline.run_until(2.0)
    assert head.true_pose(2.0) == sent != HeadPose(1.0, 0.0)


def test_unplugged_arm_that_cannot_rest_is_reported() -> None:
    notices: list[DeviceStatus] = []
    arm = JointsTwin({"elbow": JointSpec(2)}, ManualClock(), at_rest="relax", report=notices.append)
    arm.rest()
    assert notices == []
    arm.open()
    arm.plug.unplug()
    arm.close()
    assert kinds(notices) == ["online", "offline", "fault"]
    assert notices[-1].message == "could not be relaxed: elbow (servo 2)"
    assert notices[-1].hint


def test_command_to_an_unplugged_arm_applies_when_replugged() -> None:
    clock = ManualClock()
    arm = JointsTwin({"elbow": JointSpec(2), "wrist": JointSpec(3)}, clock)
    arm.open()
    arm.move({"elbow": 1.0})
    arm.plug.unplug()
    clock.advance(0.1)
    arm.relax()
    arm.plug.plug_in()
    state = arm.states()["elbow"].value
    assert state is not None
    assert (state.torque, state.moving) == (False, False)
    assert 0.1 < state.position < 0.5


def test_overload_while_unplugged_is_reported_when_replugged() -> None:
    notices: list[DeviceStatus] = []
    arm = JointsTwin({"elbow": JointSpec(2)}, ManualClock(), report=notices.append)
    arm.open()
    arm.plug.unplug()
    arm.overload("elbow")
    arm.overload("elbow")
    assert kinds(notices) == ["online", "offline"]
    arm.plug.plug_in()
    assert kinds(notices) == ["online", "offline", "online", "fault"]
    with pytest.raises(BadRequest, match="no joint 'knee'"):
        arm.overload("knee")


def test_motor_speed_is_limited() -> None:
    clock = ManualClock()
    arm = JointsTwin({"elbow": JointSpec(2, speed=99.0)}, clock)
    arm.open()
    arm.move({"elbow": 2.5})
    clock.advance(0.1)
    assert arm.true_angle("elbow", clock.now()) == pytest.approx(0.618, abs=0.01)  # 59 rpm


def test_an_unplugged_voice_is_silent_at_once() -> None:
    notices: list[DeviceStatus] = []
    said: list[str] = []
    voice = VoiceTwin(ManualClock(), said.append, report=notices.append)
    voice.open()
    words = voice.say("hello there")
    voice.plug.unplug()
    assert words.done()
    with pytest.raises(NotConnected, match="voice") as caught:
        voice.say("anybody")
    assert caught.value.hint
    voice.plug.plug_in()
    assert not voice.say("hello again").done()
    assert said == ["hello there", "hello again"]
    assert kinds(notices) == ["online", "offline", "online"]


# --- the camera -------------------------------------------------------------------------------------------------------


def picture(time: float) -> Image:
    return np.full((6, 8, 3), round(10 * time), np.uint8)


def level(camera: CameraTwin, now: float) -> float | None:
    frame = camera.expose(now)
    return None if frame is None else float(frame.image.mean())


def test_a_frozen_camera_shows_the_same_with_new_stamps() -> None:
    camera = CameraTwin(picture, ManualClock())
    camera.open()
    assert level(camera, 1.0) == 10
    camera.freeze()
    frame = camera.expose(2.0)
    assert frame is not None
    assert (frame.stamp, frame.number, frame.image.mean()) == (2.0, 1, 10)
    camera.thaw()
    assert level(camera, 3.0) == 30


def test_a_covered_camera_shows_black() -> None:
    camera = CameraTwin(picture, ManualClock())
    camera.open()
    camera.cover()
    frame = camera.expose(1.0)
    assert frame is not None
    assert frame.image.shape == (6, 8, 3)
    assert not frame.image.any()
    camera.uncover()
    assert level(camera, 2.0) == 20


def test_frozen_camera_ignores_its_cover() -> None:
    camera = CameraTwin(picture, ManualClock())
    camera.open()
    assert level(camera, 1.0) == 10
    camera.freeze()
    camera.cover()
    assert level(camera, 2.0) == 10
    camera.thaw()
    assert level(camera, 3.0) == 0


def test_lost_pictures_are_a_share_and_keep_their_numbers() -> None:
    camera = CameraTwin(picture, ManualClock(), dropouts=0.25, seed=9)
    camera.open()
    frames = [camera.expose(float(number) / 20) for number in range(400)]
    came = [frame for frame in frames if frame is not None]
    assert len(came) == pytest.approx(300, abs=40)
    assert all(frame is None or frame.number == number for number, frame in enumerate(frames))
    assert camera.health().counters == {"connections": 1, "frames": len(came), "dropped": 400 - len(came)}


def test_an_unplugged_camera_exposes_nothing() -> None:
    camera = CameraTwin(picture, ManualClock())
    assert camera.expose(0.0) is None
    camera.open()
    camera.plug.unplug()
    assert camera.expose(1.0) is None
    camera.plug.plug_in()
    assert level(camera, 2.0) == 20


@pytest.mark.parametrize("wrong", [{"rate": 0.0}, {"field_of_view": 4.0}, {"dropouts": 2.0}])
def test_invalid_camera_twin_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        CameraTwin(picture, ManualClock(), **wrong)  # type: ignore[arg-type]  # the values are floats


# --- the same for a seed ----------------------------------------------------------------------------------------------

STORY = """
import hashlib, sys
from drivers.api import Velocity
from drivers.servos.joint import JointSpec
from drivers.sim.base_body import BaseBody
from drivers.sim.timeline import Timeline
from drivers.base.twin import BaseTwin
from drivers.servos.twin import JointsTwin
from drivers.sim.wheels import SimulatedWheels

timeline, told = Timeline(), []
clock = timeline.clock
base = BaseTwin(clock, body=BaseBody(wheels=SimulatedWheels(slip=0.03, dead_time=0.1)), gyro_noise=0.02, dropouts=0.1,
                seed=int(sys.argv[1]), report=lambda notice: told.append((clock.now(), notice)))
arm = JointsTwin({name: JointSpec(number) for number, name in enumerate("abcdef")}, clock,
                 report=lambda notice: told.append((clock.now(), notice)))
for twin in (base, arm):
    twin.open()
    timeline.call_every(twin.STEP_INTERVAL, twin.step)
for step in range(200):
    base.drive(Velocity(0.3, 0.5 - step / 200))
    arm.move({"f": step / 100, "a": -step / 100})
    timeline.run_until(clock.now() + 0.05)
    told.append((base.state(), dict(arm.states())))
print(hashlib.sha256(repr(told).encode()).hexdigest())
"""


def test_the_same_seed_is_the_same_run_in_every_process() -> None:
    def run(seed: int, hashing: int) -> str:
        environment = {**os.environ, "PYTHONHASHSEED": str(hashing), "PYTHONPATH": os.pathsep.join(sys.path)}
        command = [sys.executable, "-c", STORY, str(seed)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    assert run(7, 1) == run(7, 2) != run(8, 1)
