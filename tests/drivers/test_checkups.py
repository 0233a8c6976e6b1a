"""What check-ups find: of recorded machines, of virtual devices, and of pictures."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from drivers.api import CameraFrame, Health, Image
from drivers.api.driver import DriverContext, Finding
from drivers.api.sensor_sections import CameraKeys
from drivers.api.sensors import Sound
from drivers.camera.checkup import checkup as look_through
from drivers.camera.twin import CameraTwin
from drivers.clock import ManualClock
from drivers.finding.hardware_scan import scan_hardware
from drivers.finding.machine import HostMachine
from drivers.finding.machine_check import CPU_FOLDER, THROTTLED_FILE, check_machine
from drivers.kobuki.checkup import check_reports
from drivers.kobuki.feedback import Core, FirmwareVersion, Inertia
from drivers.kobuki.wire import KobukiSubpayload
from drivers.microphone.checkup import check_microphone
from drivers.rplidar.checkup import checkup as scan_at_rest
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.virtual import VirtualRPLidar
from drivers.rplidar.wire import RPLidarHealth, RPLidarStatus
from drivers.servos.checkup import checkup as examine
from drivers.servos.declared import DynamixelKeys, JointKeys
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.sim.timeline import Timeline
from tests.drivers.desks import RecordedMachine, gives_pictures
from tests.drivers.sockets import Sockets

NOW, INSTALLED = 2_000_000_000.0, 1_900_000_000.0


@pytest.fixture
def desk(tmp_path: Path) -> RecordedMachine:
    return RecordedMachine(tmp_path / "machine")


def fit(machine: HostMachine, *, now: float = NOW, free: float = 50e9) -> Mapping[str, Finding]:
    """What is found of a machine, by what it is about."""
    desk = scan_hardware(machine, ioctl=gives_pictures)
    found = check_machine(machine, desk, now=now, installed_at=INSTALLED, folder=Path("/"), free_bytes=lambda _: free)
    return {each.about: each for each in found}


def test_unknown_machine_is_ok(desk: RecordedMachine) -> None:
    assert {each.verdict for each in fit(desk.machine).values()} == {"ok"}


def test_missing_groups_are_reported_with_the_usermod_command(desk: RecordedMachine) -> None:
    desk.write("etc/group", "root:x:0:\ndialout:x:20:\nvideo:x:44:pi\naudio:x:29:")
    found = fit(desk.stranger(29))["rights"]
    assert (found.verdict, found.message.split(":")[0]) == ("warning", "you are not in dialout, video")
    assert found.fix.startswith("sudo usermod -a -G dialout,video $USER")
    assert fit(desk.stranger(20, 29, 44))["rights"].message == "you are in dialout, video, audio"


def test_slow_adapter_busy_port_and_camera_are_reported(desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1", latency=16)
    desk.port("ttyUSB1", "1a86:55d3")
    desk.process(812, "ModemManager", "/dev/ttyUSB1")
    desk.camera()
    found = fit(desk.machine)
    slow, held = found["port /dev/ttyUSB0"], found["port /dev/ttyUSB1"]
    assert (slow.verdict, held.verdict) == ("warning", "wrong")
    assert "by 16 ms" in slow.message
    assert slow.fix.startswith("echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer")
    assert "ModemManager (process 812)" in held.message
    assert found["camera /dev/video0"] == Finding("camera /dev/video0", "HD Webcam")


@pytest.mark.parametrize(("free", "verdict"), [(50e9, "ok"), (1e9, "warning"), (0.1e9, "wrong")])
def test_free_disk_space_is_judged(desk: RecordedMachine, free: float, verdict: str) -> None:
    assert fit(desk.machine, free=free)["disk"].verdict == verdict


def test_clock_in_the_past_or_unsynchronised_is_reported(desk: RecordedMachine) -> None:
    assert fit(desk.machine, now=INSTALLED - 1)["clock"].verdict == "wrong"
    desk.write("run/systemd/timesync/other", "")
    assert fit(desk.machine)["clock"].verdict == "warning"
    desk.write("run/systemd/timesync/synchronized", "")
    assert fit(desk.machine)["clock"].verdict == "ok"


def test_powersave_governor_is_reported_except_with_intel_pstate(desk: RecordedMachine) -> None:
    desk.write(f"{CPU_FOLDER[1:]}/cpu0/cpufreq/scaling_governor", "powersave")
    desk.write(f"{CPU_FOLDER[1:]}/cpu0/cpufreq/scaling_driver", "cpufreq-dt")
    found = fit(desk.machine)["processor"]
    assert found.verdict == "warning"
    assert "tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor" in found.fix
    desk.write(f"{CPU_FOLDER[1:]}/cpu0/cpufreq/scaling_driver", "intel_pstate")
    assert fit(desk.machine)["processor"].message == "1 cores, governor powersave"


def test_load_heat_memory_and_weak_supply_are_reported(desk: RecordedMachine) -> None:
    desk.write("proc/loadavg", "9.10 5.00 3.00 4/300 1234")
    desk.write(THROTTLED_FILE[1:], "50000")
    desk.write("sys/class/thermal/thermal_zone0/temp", "84500")
    desk.write("proc/meminfo", "MemTotal:  948012 kB\nMemAvailable:   120000 kB")
    found = fit(desk.machine)
    told = {about: found[about].message for about in ("load", "power", "heat", "memory")}
    assert {found[about].verdict for about in told} == {"warning"}
    assert told["heat"] == "the processor is at 84 degC and slows down"
    assert told["memory"] == "123 MB are left"


# The arm


@pytest.fixture
def servos() -> list[VirtualServo]:
    return [VirtualServo(1), VirtualServo(2), VirtualServo(3, model="XM430-W350"), VirtualServo(4)]


@pytest.fixture
def sockets(monkeypatch: pytest.MonkeyPatch) -> Sockets:
    return Sockets(monkeypatch)


@pytest.fixture
def bus(servos: list[VirtualServo], sockets: Sockets) -> DriverContext:
    """Where the servos are plugged in."""
    sockets.devices["u2d2"] = VirtualServoBus(servos)
    return DriverContext(sockets.clock, "u2d2")


def found_of(bus: DriverContext, *joints: JointKeys) -> list[Finding]:
    keys = DynamixelKeys(port=bus.port, joints={f"joint{joint.id}": joint for joint in joints})
    return list(examine(keys, bus))


def test_healthy_servos_report_values_and_nothing_is_written(bus: DriverContext, servos: list[VirtualServo]) -> None:
    before = [bytes(servo.table) for servo in servos]
    fine, other = found_of(bus, JointKeys(id=1), JointKeys(id=3, written_model="XM430-W350"))
    assert (fine.verdict, fine.message) == ("ok", "AX-12A, firmware 24, 12.0 V, 35 degC")
    assert other.message.startswith("XM430-W350, firmware ")
    assert [bytes(servo.table)[:36] for servo in servos] == [table[:36] for table in before]
    assert all(servo.limp for servo in servos)


def test_low_voltage_is_reported_with_the_nominal_one(bus: DriverContext, servos: list[VirtualServo]) -> None:
    servos[0].voltage, servos[1].voltage = 9.4, 5.5
    low, empty = found_of(bus, JointKeys(id=1)), found_of(bus, JointKeys(id=2))
    assert (low[0].verdict, low[0].message) == ("warning", "9.4 V is low for a servo made for 12 V")
    assert (empty[0].verdict, empty[0].message) == ("wrong", "5.5 V: below 6.0 V it shuts down")


def test_hot_or_shut_down_servo_suggests_recovery(bus: DriverContext, servos: list[VirtualServo]) -> None:
    servos[0].temperature = 66.0
    servos[1].overload()
    hot, shut = found_of(bus, JointKeys(id=1)), found_of(bus, JointKeys(id=2))
    assert (hot[0].verdict, hot[0].message) == ("warning", "66 degC: at 70 degC it shuts down")
    assert hot[0].fix.startswith("mission servo torque off joint1 --robot ROBOT")
    assert (shut[0].verdict, shut[0].message) == ("wrong", "it has shut down: overload")
    assert shut[0].fix == "remove the cause, then: mission servo torque recover --robot ROBOT"


def test_other_model_missing_servo_and_wrong_limits_are_reported(
    bus: DriverContext, servos: list[VirtualServo]
) -> None:
    servos[3].set("cw_angle_limit", 400)
    found = found_of(bus, JointKeys(id=1, written_model="AX-18A"), JointKeys(id=9), JointKeys(id=4))
    assert [(each.about, each.verdict) for each in found] == [
        ("joint1 (servo 1)", "wrong"),
        ("joint9 (servo 9)", "wrong"),
        ("joint4 (servo 4)", "wrong"),
    ]
    model, missing, limits = found
    assert (model.message, model.fix) == ("it is model AX-12A, the robot file says AX-18A", "write model: AX-12A")
    assert missing.message == "does not answer"
    assert limits.message.startswith("has angle limits of 400..1023 ticks, but the joint needs")


# The base, the camera, the microphone


def heard(rate: float = 50.0, count: int = 20, **felt: int) -> list[KobukiSubpayload]:
    times = (round(number * 1000 / rate) for number in range(count))
    return [FirmwareVersion(0, 2, 1), *(Core(time_ms=time, battery_decivolts=155, **felt) for time in times)]


def test_kobuki_reports_firmware_battery_and_report_rate() -> None:
    assert list(check_reports(heard())) == [
        Finding("firmware", "1.2.0"),
        Finding("reports", "50 a second"),
        Finding("battery", "15.5 V"),
    ]


@pytest.mark.parametrize(
    ("rate", "verdict"), [(0.0, "ok"), (0.2, "ok"), (-0.6, "warning"), (3.0, "warning"), (6.0, "wrong")]
)
def test_gyro_drift_of_a_resting_kobuki_is_in_degrees_per_second(rate: float, verdict: str) -> None:
    count = 75
    turns = [Inertia(round(35990 + 100 * rate * number / 50) % 36000) for number in range(count)]
    (found,) = [each for each in check_reports([*heard(count=count), *turns]) if each.about == "gyro drift"]
    assert found.verdict == verdict
    assert float(found.message.split()[0]) == pytest.approx(rate, abs=0.02)
    pushed = [Core(time_ms=20 * number, left_encoder=number, battery_decivolts=155) for number in range(count)]
    (found,) = [each for each in check_reports([*pushed, *turns]) if each.about == "gyro drift"]
    assert found.message == "not measured: its wheels turned meanwhile"


def test_silent_lame_empty_or_lifted_kobuki_is_reported() -> None:
    assert [each.message for each in check_reports([])] == ["it is silent"]
    assert [each.message for each in check_reports(heard(rate=30.0)) if each.verdict == "warning"] == [
        "30 of 50 a second arrive"
    ]
    (empty,) = [
        each
        for each in check_reports([Core(battery_decivolts=130), Core(battery_decivolts=130, time_ms=20)])
        if each.verdict == "wrong"
    ]
    assert empty.message == "13.0 V: it is empty"
    lifted = [each.message for each in check_reports(heard(wheel_drop=3)) if each.verdict == "warning"]
    assert lifted == ["a wheel hangs in the air: it does not drive"]


@pytest.mark.parametrize(
    ("grey", "verdict", "words"),
    [(5, "wrong", "black"), (20, "warning", "dark"), (120, "ok", "120 of 255"), (250, "warning", "overexposed")],
)
def test_picture_brightness_is_judged(monkeypatch: pytest.MonkeyPatch, grey: int, verdict: str, words: str) -> None:
    exposure = exposed(monkeypatch, striped(grey))
    assert exposure.verdict == verdict
    assert words in exposure.message


def test_camera_with_single_coloured_pictures_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    exposure = exposed(monkeypatch, np.full((48, 64, 3), 120, np.uint8))
    assert (exposure.verdict, exposure.message) == (
        "wrong",
        "the pictures have a single colour (mean brightness 120 of 255)",
    )


def striped(grey: int) -> Image:
    """Return a picture of that mean brightness, in stripes of a little more and a little less."""
    picture = np.full((48, 64, 3), grey - 5, np.uint8)
    picture[:, ::2] += 10
    return picture


def exposed(patch: pytest.MonkeyPatch, picture: Image) -> Finding:
    """Return what is said of the brightness of a camera that gives one picture again and again."""
    timeline = Timeline()
    eye = CameraTwin(lambda _: picture, timeline.clock, rate=30.0, field_of_view=1.0)
    read = eye.read

    def looked(seconds: float) -> CameraFrame | None:
        timeline.run_until(timeline.clock.now() + min(seconds, 0.1))
        return read(0.0)

    patch.setattr(eye, "read", looked)
    patch.setattr("drivers.camera.checkup.make", lambda *_, **__: eye)
    found = list(look_through(CameraKeys(source="film.avi", width=64, height=48), DriverContext(timeline.clock)))
    assert [each.about for each in found] == ["rate", "exposure"]
    return found[1]


def test_unplugged_camera_is_reported_at_once() -> None:
    (found,) = look_through(CameraKeys(source="987"), DriverContext(ManualClock()))
    assert (found.verdict, found.message, found.fix) == (
        "wrong",
        "/dev/video987 does not exist",
        "mission robot camera list",
    )


def test_lidar_reports_model_and_health_without_turning(sockets: Sockets) -> None:
    lidar = VirtualRPLidar(lambda bearings, _: np.full(len(bearings), 2.0))
    sockets.devices["rplidar"] = lidar
    keys, site = RPLidarKeys(port="rplidar"), DriverContext(sockets.clock, "rplidar")
    assert [(each.about, each.verdict) for each in scan_at_rest(keys, site)] == [("device", "ok"), ("health", "ok")]
    lidar.condition = RPLidarHealth(RPLidarStatus.ERROR, 7)
    device, health = scan_at_rest(RPLidarKeys(port="rplidar", model="a2"), site)
    assert (device.verdict, device.fix) == ("warning", "write model: a1")
    assert (health.verdict, health.message) == ("wrong", "it has a fault, code 7")


class Ear:
    """A microphone that has heard half a second already."""

    name = "microphone"

    def __init__(self, level: int) -> None:
        wave = np.resize(np.array([level, -level], np.int16), 8000)
        self.sound = Sound(0, 0.0, wave)
        self.closed = False

    def open(self) -> None: ...
    def rest(self) -> None: ...
    def health(self) -> Health:
        return Health(online=True)

    def close(self) -> None:
        self.closed = True

    def read(self, after: int) -> list[Sound]:
        del after
        return [self.sound]


@pytest.mark.parametrize(("level", "words"), [(0, "muted"), (1000, "level -30 dB"), (32767, "too loud")])
def test_microphone_level_is_judged(level: int, words: str) -> None:
    ear = Ear(level)
    (found,) = check_microphone(ear, DriverContext(ManualClock()))
    assert words in found.message
    assert ear.closed
