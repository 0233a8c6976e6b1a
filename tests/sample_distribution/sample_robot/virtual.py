"""Virtual devices: what the real drivers talk to in a simulation down to the wire."""

from math import cos, sin

from drivers.api import HeadPose, Pose2D
from drivers.sim.base_body import Body
from drivers.sim.context import SimContext
from drivers.virtual.device import Plugged
from sample_robot.declared import PeriscopeKeys, RoverKeys

PERIOD = 0.02
"""Seconds between two reports."""

LIFE = 0.3
"""Seconds for which a command is valid."""


class VirtualRover:
    """A ``drivers.virtual.terminal.WireDevice`` that plays the rover, with the body of a base on two wheels."""

    def __init__(self, baud: int, body: Body) -> None:
        self.baud = baud
        self.horned: list[bytes] = []
        self._body = body
        self._start = body.pose
        self._begun = b""
        self._commanded_at = self._due = float("-inf")

    def feed(self, data: bytes, now: float) -> bytes:
        """Take commands."""
        *lines, self._begun = (self._begun + data).split(b"\n")
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
        """Report where it is, when that is due; it stands still where it is told nothing."""
        if now - self._commanded_at > LIFE:
            self._body.command(0.0, 0.0, now)
        pose = self._body.advance(now)
        if now < self._due:
            return b""
        self._due = now + PERIOD
        moves = self._body.velocity
        figures = (*_seen_from(pose, self._start), moves.linear, moves.angular)
        return b"o %s\n" % b" ".join(b"%d" % round(1000 * figure) for figure in figures)

    def pose(self, time: float) -> Pose2D:
        """Return where it truly is in the world."""
        return self._body.advance(time)


def rover(keys: RoverKeys, stage: SimContext) -> Plugged:
    """Return a virtual rover."""
    device = VirtualRover(keys.baud, stage.body())
    return Plugged(device, "rover", pose=device.pose)


def periscope(keys: PeriscopeKeys, stage: SimContext) -> Plugged:
    """Return the periscope, which sits on the arm's wire, and looks where its joints are."""
    arm = stage.parts["arm"]

    def looks(time: float) -> HeadPose:
        joints = arm.state(time)
        return HeadPose(joints[keys.turned_by], joints[keys.tilted_by])

    return Plugged(None, looks=looks)


def _seen_from(pose: Pose2D, start: Pose2D) -> tuple[float, float, float]:
    """Return a pose as the rover counts it: from where it was switched on."""

    dx, dy = pose.x - start.x, pose.y - start.y
    c, s = cos(start.heading), sin(start.heading)
    return dx * c + dy * s, dy * c - dx * s, pose.heading - start.heading
