"""From the keys of a robot file to the drivers of its parts that are reached by ROS 2."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import pi
from pathlib import Path

from drivers.api import AS_USUAL, BaseLimits, Health, JointLimits, Manner, Priority, Report, Utterance, ignore
from drivers.api.driver import Site
from drivers.base.arbitrated import settings_of
from drivers.base.diff_drive import DiffDriveBase
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.head.joints_head import JointAxis, NeckDriver
from drivers.pictures.capture import ThreadedCamera
from drivers.ros2 import base as bases
from drivers.ros2 import wire
from drivers.ros2.camera import TopicFeed
from drivers.ros2.declared import (
    Ros2ArmKeys,
    Ros2AxisKeys,
    Ros2BaseKeys,
    Ros2CameraKeys,
    Ros2HeadKeys,
    Ros2RangeKeys,
    Ros2VoiceKeys,
    ZenohKeys,
)
from drivers.ros2.graph import Ros2Graph
from drivers.ros2.joints import TopicJoints
from drivers.ros2.line import Channel, absent, link
from drivers.ros2.node import TopicFaults
from drivers.ros2.ranger import SCAN, Ros2Ranger
from drivers.ros2.session import access_of
from drivers.ros2.types import types
from drivers.ros2.ways import TopicJoint, channels_of
from drivers.sound.printed import PrintedVoice
from drivers.transport.link import Link

# A voice of a robot of ROS 2: each text goes to a topic in its turn, for whoever speaks there.

STRING = "std_msgs/msg/String"


class Ros2Voice(PrintedVoice):
    """A ``drivers.api.Voice`` over a link to a topic. Nobody tells when something was said: it lasts as its speed says.

    What has been sent cannot be taken back: cancelled, it is waited for no longer, and what waits is not sent.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        channel: Channel,
        *,
        usual: Manner = AS_USUAL,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        super().__init__(clock, self._send, usual=usual, changed=changed)
        self._link, self._channel = link, channel
        self._faults = TopicFaults(self.name, [channel.topic], clock, report)
        self._finder = wire.FrameFinder()
        self._kind = ""

    def open(self) -> None:
        """Start looking for who listens; returns at once."""
        super().open()
        self._link.open(self)

    def close(self) -> None:
        """Send nothing any more."""
        super().close()
        self._link.close()

    def health(self) -> Health:
        """Say whether somebody listens."""
        link, health = self._link.health(), super().health()
        if not health.online:
            return health
        if not link.online:
            return Health(False, link.detail, link.hint, {**link.counters, **health.counters})
        if not self._kind:
            error = absent(self.name, self._channel, self._faults.why(0))
            return Health(False, str(error), error.hint, {**link.counters, **health.counters})
        return replace(health, counters={**link.counters, **health.counters})

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Send ``text`` in its turn. Raises NotConnected while nobody listens."""
        health = self.health()
        if not health.online:
            raise NotConnected(health.detail, hint=health.hint)
        return super().say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Refuse: a topic of texts has no sounds. Raises BadRequest."""
        del priority
        raise BadRequest(
            f"{self.name}: cannot play {path.name}: {self._channel.topic} takes texts alone", hint="say it"
        )

    # --- the link's thread: see drivers.transport.link.Talker --------------------------------------------------------

    def connected(self) -> None:
        """Ask who listens."""
        self._finder, self._kind = wire.FrameFinder(), ""
        self._link.write(wire.ASK)

    def received(self, data: bytes) -> None:
        """Take note of who listens."""
        for channel, payload in self._finder.feed(data):
            if channel == wire.ABOUT:
                self._kind = next(iter(wire.told(payload)[1]), "")
            elif channel == wire.MISMATCH:
                self._faults.mismatch(payload)

    def pulse(self) -> None:
        """Let what waits have its turn."""
        self.settle()

    def ending(self) -> None:
        """Do nothing: silence is its rest."""

    def _send(self, text: str) -> None:
        try:
            self._link.write(wire.frame(0, types().encode(STRING, {"data": text})))
        except NotConnected:
            return  # its health says so; the words are lost


# A head of two joints of a robot of ROS 2, led in small steps by their own topics.


class Ros2Head(NeckDriver):
    """A ``JointsHead`` that steps itself, and opens and closes the ``TopicJoints`` that it is made of."""

    _joints: TopicJoints

    def open(self) -> None:
        """Start looking for its topics; returns at once."""
        self._joints.open()
        super().open()

    def close(self) -> None:
        """Stand where it is, and listen no more. Safe from any state, more than once."""
        super().close()
        self._joints.close()

    @property
    def latched(self) -> str:
        """Why it moves no more until it is enabled; empty while it does."""
        return self._joints.latched

    def enable(self) -> None:
        """Let it move again, after it was away for long."""
        self._joints.enable()


def domain_of(keys: ZenohKeys) -> int:
    """Return the domain of a robot file, else that of the environment. Raises BadRequest for one that is none."""
    told = os.environ.get("ROS_DOMAIN_ID", "").strip() if keys.domain is None else str(keys.domain)
    if told and not (told.isdigit() and int(told) <= 232):
        raise BadRequest(f"ros2: ROS_DOMAIN_ID is '{told}': it must be a number from 0 to 232", hint="unset it")
    return int(told or 0)


def graph(keys: ZenohKeys, site: Site) -> Ros2Graph:
    """Return the nodes of ROS 2."""
    return Ros2Graph(
        access_of(keys, site.port), site.clock, keys, domain=domain_of(keys), report=site.report, changed=site.changed
    )


def topics_of(keys: Ros2BaseKeys) -> dict[str, str]:
    """Return the topics of a base that its file names, by the words for them."""
    return {word: getattr(keys, word) for word in bases.KINDS if getattr(keys, word)}


def base(keys: Ros2BaseKeys, site: Site) -> DiffDriveBase:
    """Return the driver of a base."""
    nodes: Ros2Graph = site.parts["ros2"]
    topics = topics_of(keys)
    channels = [Channel(nodes.full(topic), bases.KINDS[word], word in bases.SENT) for word, topic in topics.items()]
    limits = BaseLimits(keys.max_speed, keys.max_turn, keys.acceleration, keys.turn_acceleration)
    protocol = bases.Ros2BaseProtocol(
        "base", site.clock, channels, list(topics), limits, anchored=nodes.anchor, entrusted=nodes.has_goal
    )
    line = link("base", nodes.node, channels, site.report)
    return DiffDriveBase(line, site.clock, protocol, on_stop=nodes.stop, **settings_of(keys, site))


def ranger(keys: Ros2RangeKeys, site: Site) -> Ros2Ranger:
    """Return the driver of a range finder."""
    nodes: Ros2Graph = site.parts["ros2"]
    channel = Channel(nodes.full(keys.scan), (SCAN,), depth=1)
    line = link("range", nodes.node, [channel], site.report)
    return Ros2Ranger(
        line, site.clock, channel, place=keys.place, blind=keys.blind, report=site.report, changed=site.changed
    )


def camera(keys: Ros2CameraKeys, site: Site) -> ThreadedCamera:
    """Return the driver of a camera."""
    nodes: Ros2Graph = site.parts["ros2"]
    topic = nodes.full(keys.image)
    return ThreadedCamera(
        lambda: TopicFeed(nodes.node, topic, site.clock, site.report),
        site.clock,
        name="camera",
        field_of_view=keys.upright().field_of_view,
        loop=False,
        retry=0.3,
        report=site.report,
        turn=keys.turn,
    )


def joints_of_arm(keys: Ros2ArmKeys) -> Mapping[str, TopicJoint]:
    """Return the joints of an arm."""
    limits = keys.limits
    return {
        name: TopicJoint(joint.joint or name, limits[name], -1 if joint.reverse else 1)
        for name, joint in keys.joints.items()
    }


def joints_of_head(keys: Ros2HeadKeys) -> Mapping[str, TopicJoint]:
    """Return the joints of a head: how far it turns by them is up to its axes, with their trims."""
    limits = JointLimits(-pi, pi, keys.speed)
    return {axis.joint: TopicJoint(axis.joint, limits, -1 if axis.reverse else 1) for axis in (keys.pan, keys.tilt)}


def _joints(part: str, keys: Ros2ArmKeys | Ros2HeadKeys, joints: Mapping[str, TopicJoint], site: Site) -> TopicJoints:
    nodes: Ros2Graph = site.parts["ros2"]
    channels = channels_of(keys.states, keys.command, joints, nodes.full)
    line = link(part, nodes.node, channels, site.report)
    return TopicJoints(line, site.clock, channels, joints, name=part, away=keys.away, report=site.report)


def arm(keys: Ros2ArmKeys, site: Site) -> TopicJoints:
    """Return the driver of an arm."""
    return _joints(site.part, keys, joints_of_arm(keys), site)


def axis(keys: Ros2AxisKeys) -> JointAxis:
    """Return one joint of a head."""
    return JointAxis(keys.joint, keys.lower, keys.upper, trim=keys.trim)


def head(keys: Ros2HeadKeys, site: Site) -> Ros2Head:
    """Return the driver of a head."""
    joints = _joints("head", keys, joints_of_head(keys), site)
    return Ros2Head(
        joints,
        site.clock,
        pan=axis(keys.pan),
        tilt=axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=site.report,
        changed=site.changed,
    )


def voice(keys: Ros2VoiceKeys, site: Site) -> Ros2Voice:
    """Return the driver of a voice."""
    nodes: Ros2Graph = site.parts["ros2"]
    channel = Channel(nodes.full(keys.topic), (STRING,), sends=True)
    line = link("voice", nodes.node, [channel], site.report)
    return Ros2Voice(line, site.clock, channel, usual=keys.manner, report=site.report, changed=site.changed)
