"""Programs that know nothing of ours scan, read and move the virtual servos, each in a process of its own."""

import json
import subprocess
import sys
from importlib.util import find_spec
from math import cos, degrees, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.clock import SystemClock
from drivers.rplidar.virtual import VirtualRPLidar
from drivers.servos.calibration import format_calibration, load_calibration
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal, WireDevice
from tests.drivers.chains import chain, mixed_chain

pytestmark = pytest.mark.real_time

CLIENTS = Path(__file__).parent.parent / "other_programs"


def needs(package: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(find_spec(package) is None, reason=f"{package} is not installed: `make test` installs it")


def told(client: str, bus: WireDevice, *arguments: str) -> dict[str, Any]:
    """Let ``client`` have its way with ``bus``; return what it saw."""
    terminal = PseudoTerminal("servos", bus, SystemClock())
    terminal.open()
    try:
        command = [sys.executable, str(CLIENTS / f"{client}.py"), *arguments, terminal.path]
        done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    finally:
        terminal.close()
    assert done.returncode == 0, done.stderr
    seen: dict[str, Any] = json.loads(done.stdout)
    return seen


@needs("pypot")
def test_pypot_scans_reads_and_moves_and_a_goal_beyond_the_limits_is_clamped() -> None:
    bus = mixed_chain("AX-12A", "MX-28", "RX-64")
    bus.servo(3).temperature = 41.0
    seen = told("pypot_client", bus)
    assert seen["found"] == [1, 2, 3]
    assert seen["models"] == ["AX-12", "MX-28", "RX-64"]
    assert seen["volts"] == [12.0, 12.0, 12.0]
    assert seen["degrees celsius"] == [35, 35, 41]
    assert seen["limits"][1] == pytest.approx([-40, 40], abs=0.1)
    assert seen["positions"] == pytest.approx([30, 40, -30], abs=0.4)
    assert seen["goals"] == pytest.approx([30, 40, -30], abs=0.4)
    assert seen["complaints of limits"] == 0  # nobody answers a sync write, and later replies tell lasting states alone
    assert seen["stiff"] == [False, False, False]
    assert [degrees(servo.angle) for servo in bus.servos] == pytest.approx([30, 40, -30], abs=0.4)


@needs("pyax12")
def test_pyax12_scans_reads_and_moves() -> None:
    bus = chain(2)
    bus.servo(1).voltage = 11.1
    seen = told("pyax12_client", bus)
    assert seen["found"] == [1, 2]
    assert (seen["model"], seen["volts"], seen["degrees celsius"], seen["rate"]) == (12, 11.1, 35, 1_000_000)
    assert seen["position"] == pytest.approx(45, abs=0.4)
    assert seen["bytes"] == 50
    assert bus.servo(2).angle == pytest.approx(radians(45), abs=0.01)  # it counts 300/1023 degrees a step


def test_vendor_sdk_works_with_protocol_1() -> None:
    bus = mixed_chain("AX-12A", "MX-28", "MX-64")
    seen = told("sdk_client", bus, "1")
    assert seen["found"] == [1, 2, 3]
    assert seen["models"] == [12, 29, 310]
    assert seen["refused"] == [0, 8]
    assert seen["positions"] == [600, 2500, 1500]
    assert seen["bulk read"] == [2500, 1500]
    assert seen["led"] == 1
    assert seen["reset of the AX"] == [0, 0]
    assert seen["at another rate"]


def test_vendor_sdk_works_with_protocol_2() -> None:
    bus = chain(3, "XL430-W250")
    bus.servo(3).overload()
    seen = told("sdk_client", bus, "2")
    assert seen["found"] == {"1": 1060, "2": 1060, "3": 1060}
    assert seen["alert of 3"] == [32, 0, 128]
    assert seen["silent while it starts"]
    assert seen["error of 3 after a reboot"] == [0, 0, 0]
    assert seen["sync read"] == seen["fast sync read"] == [2148, 1948, 2248]
    assert seen["bulk read"] == seen["fast bulk read"] == [120, 35]
    assert seen["bulk write"] == [1, 50]
    assert seen["EEPROM under torque"] == [0, 7]
    assert seen["beyond the limits"] == [0, 6]
    assert seen["EEPROM without"] == [0, 0]


@needs("lerobot")
def test_lerobots_own_bus_calibrates_reads_and_moves_a_chain_of_feetech_servos(tmp_path: Path) -> None:
    bus = chain(3, "STS3215")
    bus.servo(1).turn_by_hand(1.0)
    seen = told("lerobot_client", bus, "all")
    assert (seen["models"], seen["firmware"], seen["missing"]) == ([777, 777, 777], ["3.10"], None)
    assert (seen["unlocked"], seen["locked"]) == ([0, 0, 0], [1, 1, 1])
    assert set(seen["homed"].values()) == {2047}
    assert seen["homings"]["pan"] == pytest.approx(1.0 / (radians(360) / 4096), abs=2)
    assert seen["is calibrated"]
    assert seen["arrived"]
    assert seen["positions"] == pytest.approx({"pan": 30, "elbow": -40, "jaw": 25}, abs=0.2)
    assert seen["beyond the limits"] == seen["calibration"]["pan"]["range_max"] == 3000
    assert seen["negative goal"] == [-321, -1234]
    file = tmp_path / "lerobot.json"
    file.write_text(json.dumps(seen["calibration"], indent=4), encoding="utf-8")
    assert {name: each.homing_offset for name, each in load_calibration(str(file)).items()} == seen["homings"]
    assert format_calibration(load_calibration(str(file))).strip() == file.read_text(encoding="utf-8")


@needs("lerobot")
def test_lerobot_sets_up_a_servo_at_another_rate() -> None:
    bus = VirtualServoBus([VirtualServo(1, model="STS3215")], 115_200)
    assert told("lerobot_client", bus, "alone") == {"found": 777, "at": 1_000_000}
    servo = bus.servos[0]
    servo.power_cycle()
    assert (servo.number, servo.settings.baud) == (2, 1_000_000)


@needs("scservo_sdk")
def test_feetech_sdk_scans_reads_moves_and_reads_faults() -> None:
    bus = chain(3, "STS3215")
    bus.servo(3).temperature = 90.0
    seen = told("scservo_client", bus)
    assert (seen["found"], seen["models"]) == ([1, 2, 3], [777, 777, 777])
    assert seen["errors"] == ["", "[RxPacketError] Overheat error!"]
    assert (seen["sent"], seen["arrived"], seen["positions"]) == (0, True, [2500, 1500, 2048])
    assert seen["limits"] == [0, 4095]
    assert seen["held until action"]


@needs("pyrplidarsdk")
@pytest.mark.parametrize(
    ("model", "number", "firmware"), [("a1", 24, (1, 29)), ("a1", 24, (1, 20)), ("a2", 40, (1, 29))]
)
def test_slamtecs_sdk_gets_a_scan(model: str, number: int, firmware: tuple[int, int]) -> None:
    def pillar(bearings: Any, _now: float) -> Any:
        """A metre away up to half a radian to both sides, all else two."""
        return np.where(np.cos(bearings) > cos(0.5), 1.0, 2.0)

    seen = told("slamtec_client", VirtualRPLidar(pillar, model=model, firmware=firmware))
    assert (seen["connected"], seen["model"], seen["health"], seen["scans"]) == (True, number, 0, True)
    assert seen["firmware"] == firmware[0] << 8 | firmware[1]
    bearings, distances = np.array(seen["bearings"]), np.array(seen["distances"])
    assert len(bearings) > 300
    sure = np.abs(np.cos(bearings) - cos(0.5)) > 0.02
    assert distances[sure] == pytest.approx(pillar(bearings[sure], 0.0), rel=0.1)
