"""Virtual devices at wire level, for the real drivers."""

from math import cos, sin

from drivers.api import HeadPose, Pose2D
from drivers.sim.base_body import BaseBody
from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice
from sample_robot.declared import PeriscopeKeys, RoverKeys

REPORT_INTERVAL = 0.02
"""Seconds between two reports."""

COMMAND_TIMEOUT = 0.3
"""Seconds for which a command is valid."""


class VirtualRover:
    """Virtual rover with the body of a base on two wheels: a ``drivers.virtual.terminal.WireDevice``."""

    def __init__(self, baud: int, body: BaseBody) -> None:
        self.baud = baud
        self.horned: list[bytes] = []
        self._body = body
        self._start = body.pose
        self._partial_line = b""
        self._commanded_at = self._due = float("-inf")

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle commands; return the report that is due."""
        *lines, self._partial_line = (self._partial_line + data).split(b"\n")
        for line in lines:
            word, *figures = line.split()
            if word == b"v" and len(figures) == 2:
                linear, angular = (int(figure) / 1000 for figure in figures)
                self._body.command(linear, angular, now)
                self._commanded_at = now
            elif word == b"b":
                self.horned.append(line)
        return self.poll(now)

    def poll(self, now: float) -> bytes:
        """Return the report that is due; stop after ``COMMAND_TIMEOUT`` seconds without a command."""
        if now - self._commanded_at > COMMAND_TIMEOUT:
            self._body.command(0.0, 0.0, now)
        pose = self._body.advance(now)
        if now < self._due:
            return b""
        self._due = now + REPORT_INTERVAL
        moves = self._body.velocity
        figures = (*_seen_from(pose, self._start), moves.linear, moves.angular)
        return b"o %s\n" % b" ".join(b"%d" % round(1000 * figure) for figure in figures)

    def pose(self, time: float) -> Pose2D:
        """Return the true pose in the world."""
        return self._body.advance(time)


def rover(keys: RoverKeys, context: SimContext) -> VirtualDevice:
    """Return a virtual rover."""
    device = VirtualRover(keys.baud, context.make_body())
    return VirtualDevice(device, "rover", pose=device.pose)


def periscope(keys: PeriscopeKeys, context: SimContext) -> VirtualDevice:
    """Return the periscope, which is on the arm's wire, with the direction of its joints."""
    arm = context.parts["arm"]

    def head_pose(time: float) -> HeadPose:
        joints = arm.state(time)
        return HeadPose(joints[keys.turned_by], joints[keys.tilted_by])

    return VirtualDevice(None, head_pose=head_pose)


def _seen_from(pose: Pose2D, start: Pose2D) -> tuple[float, float, float]:
    """Return a pose relative to the one at power-on, as the rover reports it."""

    dx, dy = pose.x - start.x, pose.y - start.y
    c, s = cos(start.heading), sin(start.heading)
    return dx * c + dy * s, dy * c - dx * s, pose.heading - start.heading
