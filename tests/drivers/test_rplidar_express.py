"""Express scans: their capsules, who is asked for them, and what becomes of them on a bad wire."""

import struct
from random import Random

import numpy as np
import pytest

from drivers.rplidar import capsules
from drivers.rplidar.capsules import CAPSULE_NODES, CAPSULE_SIZE, CapsuleFinder, pack_capsule
from drivers.rplidar.nodes import STEPS_PER_TURN
from drivers.rplidar.virtual import VirtualRPLidar
from drivers.rplidar.wire import EXPRESS_REQUEST, RPLidarCommand, request
from tests.drivers.test_rplidar_driver import FAR, Bench, all_round

STEP = 16 * 64
"""Steps of the angle from one capsule to the next."""


def distances(number: int) -> np.ndarray[tuple[int], np.dtype[np.uint16]]:
    return (np.arange(number * CAPSULE_NODES, (number + 1) * CAPSULE_NODES, dtype=np.uint16) % 3000 + 200) * 4


def stream(count: int) -> bytes:
    return b"".join(
        pack_capsule(number * STEP % STEPS_PER_TURN, distances(number), first=number == 0) for number in range(count)
    )


def test_capsule_matches_the_protocol() -> None:
    data = pack_capsule(0x1234, np.array([0x0FFF, 0x8000] * 16, np.uint16), first=True)
    assert len(data) == CAPSULE_SIZE
    assert data[2:9] == b"\x34\x92\xfc\x0f\x00\x80\x00"
    check = 0x34 ^ 0x92  # sixteen equal cabins are no more than none
    assert data[:2] == bytes((0xA0 | check & 15, 0x50 | check >> 4))


def test_capsules_are_parsed_for_any_chunking() -> None:
    whole, random = stream(60), Random(1)  # noqa: S311 - chance, not a secret
    finder, angles, far, new, at = CapsuleFinder(), list[int](), list[int](), 0, 0
    while at < len(whole):
        end = at + random.randrange(1, 200)
        nodes = finder.feed(whole[at:end])
        angles += nodes.angle.tolist()
        far += nodes.distance.tolist()
        new += int(nodes.new.sum())
        at = end
    assert len(angles) == finder.nodes == 59 * CAPSULE_NODES
    assert angles == [number * STEP // CAPSULE_NODES % STEPS_PER_TURN for number in range(59 * CAPSULE_NODES)]
    assert far == np.concatenate([distances(number) for number in range(59)]).tolist()
    assert new == 59 * STEP // STEPS_PER_TURN
    assert (finder.skipped_bytes, finder.resyncs) == (0, 0)


def test_angle_corrections_are_in_eighths_of_a_degree() -> None:
    data = bytearray(pack_capsule(640, np.full(CAPSULE_NODES, 4000, np.uint16)))
    data[4] |= 0b01  # the upper bits of the first
    data[8] = 0x8F  # the lower ones of the second and the first
    check = 0
    for byte in data[2:]:
        check ^= byte
    data[0], data[1] = 0xA0 | check & 15, 0x50 | check >> 4
    nodes = CapsuleFinder().feed(
        bytes(data) + pack_capsule(640 + CAPSULE_NODES * 8, np.zeros(CAPSULE_NODES, np.uint16))
    )
    assert nodes.angle[:3].tolist() == [640 - 0x1F * 8, 648 - 8 * 8, 656]
    assert set(nodes.distance.tolist()) == {4000}


def test_damage_costs_only_its_capsules() -> None:
    whole, random = stream(400), Random(2)  # noqa: S311 - chance, not a secret
    true = {tuple(row) for number in range(400) for row in _rows(number)}
    left = (byte for byte in whole if random.random() > 5e-4)
    data = bytes(byte ^ 1 << random.randrange(8) if random.random() < 0.001 else byte for byte in left)
    finder = CapsuleFinder()
    nodes = finder.feed(data)
    assert len(nodes) > 0.6 * 400 * CAPSULE_NODES
    made_up = [row for row in zip(nodes.angle.tolist(), nodes.distance.tolist(), strict=True) if row not in true]
    assert len(made_up) <= 4, "but where the same bit of two bytes was hit, which no XOR tells"
    assert finder.resyncs > 10


def _rows(number: int) -> list[tuple[int, int]]:
    places = (number * STEP + np.arange(CAPSULE_NODES) * STEP // CAPSULE_NODES) % STEPS_PER_TURN
    return list(zip(places.tolist(), distances(number).tolist(), strict=True))


@pytest.mark.parametrize(
    ("firmware", "express"), [((1, 15), False), ((1, 16), False), ((1, 17), True), ((1, 29), True)]
)
def test_supporting_firmware_gets_an_express_scan(firmware: tuple[int, int], express: bool) -> None:
    bench = Bench(firmware=firmware)
    bench.run(3.0)
    assert (bench.lidar.requests.get(RPLidarCommand.EXPRESS, 0), bench.lidar.requests.get(RPLidarCommand.SCAN, 0)) == (
        (1, 0) if express else (0, 1)
    )
    scan = bench.device.scan()
    assert scan.good
    assert scan.value is not None
    assert float(np.nanmedian(scan.value.ranges)) == pytest.approx(FAR, rel=0.02)
    before = bench.device.health().counters["nodes"]
    bench.run(1.0)
    assert bench.device.health().counters["nodes"] - before == pytest.approx(4000 if express else 2000, abs=80)


class Deaf(VirtualRPLidar):
    """Says that it is new, and yet knows nothing of express scans."""

    def _execute_newer(self, *_: object) -> bytes:
        return b""


def test_silent_express_request_falls_back_to_a_plain_scan() -> None:
    bench = Bench()
    bench.link._lidar = bench.lidar = Deaf(all_round)
    bench.run(3.0)
    assert bench.lidar.requests[RPLidarCommand.SCAN] == 1
    assert bench.device.scan().good


def test_lossy_wire_falls_back_to_a_plain_scan() -> None:
    bench, random = Bench(firmware=(1, 29)), Random(3)  # noqa: S311 - chance, not a secret
    bench.run(1.0)
    assert bench.device.scan().good
    bench.link.distort = lambda data: bytes(byte for byte in data if random.random() > 0.003)
    bench.run(4.0)
    assert bench.lidar.requests[RPLidarCommand.SCAN] == 1
    assert bench.device.scan().good
    assert bench.notices == []


def test_virtual_range_finder_reports_its_scan_modes() -> None:
    lidar = VirtualRPLidar(all_round)

    def asked(kind: int, *mode: int) -> bytes:
        payload = struct.pack("<I", kind) + b"".join(struct.pack("<H", each) for each in mode)
        return lidar.feed(request(RPLidarCommand.SETTING, payload), 0.0)

    def told(kind: int, data: bytes) -> bytes:
        return b"\xa5\x5a" + struct.pack("<IB", 4 + len(data), 0x20) + struct.pack("<I", kind) + data

    assert lidar.feed(request(RPLidarCommand.SAMPLE_RATES), 0.0) == b"\xa5\x5a\x04\0\0\0\x15" + struct.pack(
        "<HH", 500, 250
    )
    assert asked(0x70) == told(0x70, b"\x02\0")
    assert asked(0x7C) == told(0x7C, b"\x01\0")
    assert asked(0x71, 1) == told(0x71, struct.pack("<I", 250 * 256))
    assert asked(0x74, 0) == told(0x74, struct.pack("<I", 12 * 256))
    assert asked(0x75, 1) == told(0x75, b"\x82")
    assert asked(0x7F, 0) == told(0x7F, b"Standard\0")
    assert (
        asked(0x7F, 2)
        == asked(0x7F)
        == asked(0x99, 0)
        == lidar.feed(request(RPLidarCommand.SETTING, b"\x70"), 0.0)
        == b""
    )


def test_forced_scan_measures_with_a_stuck_motor() -> None:
    lidar = VirtualRPLidar(all_round)
    lidar.is_stuck = True
    for command, heard in (
        (request(RPLidarCommand.SCAN), False),
        (EXPRESS_REQUEST, False),
        (request(RPLidarCommand.FORCE_SCAN), True),
    ):
        assert lidar.feed(command, 0.0)
        assert bool(lidar.poll(1.0)) == heard
        lidar.feed(request(RPLidarCommand.STOP), 1.0)
    assert capsules.EXPRESS_SAMPLE_RATE == 4000.0
