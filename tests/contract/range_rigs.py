"""A range finder in a room, whatever it is made of: the RPLIDAR's driver over its wire, and its twin."""

from math import pi, radians

from drivers.api import Pose2D, Ranger, RangeScan
from drivers.base.range_twin import RangerTwin
from drivers.ros2.ranger import Ros2Ranger
from drivers.ros2.virtual_topics import VirtualScan
from drivers.rplidar.make import GATHER_TIME, RPLidar
from drivers.rplidar.virtual import VirtualRPLidar
from drivers.sim.room import Room
from drivers.sim.scanner import make_range_function
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import WorldBox
from tests.contract.rigs import InSimulatedTime, Rig
from tests.drivers.cranked import HandWire

WORLD = SimulatedWorld(
    room=Room(8.0, 30.0, 2.6, (1.0, 0.0), fixtures=()),
    furniture=(WorldBox("pillar", 0.0, 1.3, (0.6, 0.6, 2.0), (90, 90, 90)),),
)
"""A hall: walls 5 m ahead of (0, 0) and 3 m behind it, none in reach to the right, and a pillar on the left."""

START = Pose2D(0.0, 0.0, 0.0)
PLACE = (0.1, 0.0, pi)
BLIND = ((radians(100), radians(120)),)


class RangeRig(Rig):
    device: Ranger

    def __init__(self) -> None:
        super().__init__()
        self.base = START
        self.look = make_range_function(WORLD, PLACE, lambda _: self.base)

    def start(self) -> None:
        self.device.open()
        self.until(lambda: self.device.scan().good)

    def scan(self) -> RangeScan:
        value = self.device.scan().value
        assert value is not None
        return value

    def next_scan(self, count: int = 1) -> RangeScan:
        """The scan that comes ``count`` turns later."""
        enough = self.scan().number + count
        self.until(lambda: self.scan().number >= enough)
        return self.scan()


class WireRange(InSimulatedTime, RangeRig):
    model = "a1"

    def __init__(self) -> None:
        super().__init__()
        self.lidar = VirtualRPLidar(self.look, model=self.model, yaw=PLACE[2], seed=4)
        self.wire = HandWire(self.lidar, self.timeline)
        link = self.wire.link("range", gather=GATHER_TIME, report=self.notices.append)
        self.device = RPLidar(
            link,
            self.clock,
            model=self.model,
            place=PLACE,
            blind=BLIND,
            report=self.notices.append,
            changed=self.changed,
        )

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class WireRangeA2(WireRange):
    model = "a2"


class TopicRange(InSimulatedTime, RangeRig):
    """Its scans come by ROS 2."""

    def __init__(self) -> None:
        super().__init__()
        self.robot = VirtualScan(self.look, "/scan", yaw=PLACE[2], seed=4)
        self.wire = HandWire(self.robot, self.timeline)
        self.device = Ros2Ranger(
            self.wire.link("range", report=self.notices.append),
            self.clock,
            self.robot.channels[0],
            place=PLACE,
            blind=BLIND,
            changed=self.changed,
        )

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class TwinRange(InSimulatedTime, RangeRig):
    def __init__(self) -> None:
        super().__init__()
        self.twin = RangerTwin(
            self.look,
            self.clock,
            place=PLACE,
            blind=BLIND,
            report=self.notices.append,
            changed=self.changed,
            seed=4,
        )
        self.device = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()

    def close(self) -> None:
        self.twin.close()
