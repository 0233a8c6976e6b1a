"""Factories of the drivers of ROS 2 parts, and the drivers of a voice and of a head."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import pi
from pathlib import Path

from drivers.api import (
    DEFAULT_STYLE,
    BaseLimits,
    Health,
    JointLimits,
    Priority,
    SpeechStyle,
    StatusCallback,
    Utterance,
    ignore,
)
from drivers.api.driver import DriverContext
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
from drivers.ros2.joint_topics import TopicJoint, joint_channels
from drivers.ros2.joints import TopicJoints
from drivers.ros2.node import TopicFaults
from drivers.ros2.ranger import LASER_SCAN, Ros2Ranger
from drivers.ros2.session import zenoh_access
from drivers.ros2.topic_port import TopicChannel, absent_error, make_link
from drivers.ros2.types import types
from drivers.sound.printed_voice import PrintedVoice
from drivers.transport.link import SerialLink

# A voice of a ROS 2 robot: it publishes each text in turn, for a speech node.

STRING = "std_msgs/msg/String"


class Ros2Voice(PrintedVoice):
    """Voice over a link to a ROS 2 topic: a ``drivers.api.Voice``.

    The topic does not report the end of a text, so its duration is estimated from the speed of speech. A text that was
    sent cannot be stopped: cancelling it ends only the wait. Texts still in the queue are dropped.
    """

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        channel: TopicChannel,
        *,
        usual: SpeechStyle = DEFAULT_STYLE,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        super().__init__(clock, self._send, default_manner=usual, changed=changed)
        self._link, self._channel = link, channel
        self._faults = TopicFaults(self.name, [channel.topic], clock, report)
        self._finder = wire.TopicFrameFinder()
        self._listener_type = ""

    def open(self) -> None:
        """Start looking for a subscriber; returns at once."""
        super().open()
        self._link.open(self)

    def close(self) -> None:
        """Disconnect; queued texts are dropped."""
        super().close()
        self._link.close()

    def health(self) -> Health:
        """Return online if the topic has a subscriber."""
        link, health = self._link.health(), super().health()
        if not health.online:
            return health
        if not link.online:
            return Health(False, link.detail, link.hint, {**link.counters, **health.counters})
        if not self._listener_type:
            error = absent_error(self.name, self._channel, self._faults.fault(0))
            return Health(False, str(error), error.hint, {**link.counters, **health.counters})
        return replace(health, counters={**link.counters, **health.counters})

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue ``text``. Raises NotConnected without a subscriber."""
        health = self.health()
        if not health.online:
            raise NotConnected(health.detail, hint=health.hint)
        return super().say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Raise BadRequest: a text topic cannot play sounds."""
        del priority
        raise BadRequest(
            f"{self.name}: cannot play {path.name}: {self._channel.topic} accepts only text", hint="use `say`"
        )

    # --- the link's thread: see drivers.transport.link.LinkHandler ----------------------------------------------------

    def on_connected(self) -> None:
        """Reset the state of the connection, and request the types of the subscribers."""
        self._finder, self._listener_type = wire.TopicFrameFinder(), ""
        self._link.write(wire.DISCOVERY_REQUEST)

    def on_data(self, data: bytes) -> None:
        """Handle control frames about subscribers."""
        for channel, payload in self._finder.feed(data):
            if channel == wire.ABOUT_CHANNEL:
                self._listener_type = next(iter(wire.parse_about(payload)[1]), "")
            elif channel == wire.MISMATCH_CHANNEL:
                self._faults.mismatch(payload)

    def on_poll(self) -> None:
        """Process the queue of texts."""
        self.update()

    def on_closing(self) -> None:
        """Do nothing: no command is needed before the link closes."""

    def _send(self, text: str) -> None:
        try:
            self._link.write(wire.frame(0, types().encode(STRING, {"data": text})))
        except NotConnected:
            return  # its health reports it; the text is lost


# A head of two joints of a ROS 2 robot, moved in small steps by their topics.


class Ros2Head(NeckDriver):
    """Head of ROS 2: a ``NeckDriver`` that opens and closes its own ``TopicJoints``."""

    _joints: TopicJoints

    def open(self) -> None:
        """Start connecting to the topics of the joints; returns at once."""
        self._joints.open()
        super().open()

    def close(self) -> None:
        """Hold, and disconnect. Safe from any state, more than once."""
        super().close()
        self._joints.close()

    @property
    def latched(self) -> str:
        """Reason for which the head is latched; empty if it is not."""
        return self._joints.latched

    def enable(self) -> None:
        """Release the latch after a long absence."""
        self._joints.enable()


def ros_domain(keys: ZenohKeys) -> int:
    """Return the ROS domain from the robot file, else from ``ROS_DOMAIN_ID``, else 0. Raises BadRequest if invalid."""
    told = os.environ.get("ROS_DOMAIN_ID", "").strip() if keys.domain is None else str(keys.domain)
    if told and not (told.isdigit() and int(told) <= 232):
        raise BadRequest(f"ros2: ROS_DOMAIN_ID is '{told}': it must be a number from 0 to 232", hint="unset it")
    return int(told or 0)


def graph(keys: ZenohKeys, site: DriverContext) -> Ros2Graph:
    """Return the ROS 2 nodes of a robot."""
    return Ros2Graph(
        zenoh_access(keys, site.port),
        site.clock,
        keys,
        domain=ros_domain(keys),
        report=site.report,
        changed=site.on_change,
    )


def base_topics(keys: Ros2BaseKeys) -> dict[str, str]:
    """Return the configured topics of a base, by key."""
    return {word: getattr(keys, word) for word in bases.TOPIC_TYPES if getattr(keys, word)}


def base(keys: Ros2BaseKeys, site: DriverContext) -> DiffDriveBase:
    """Return the driver of a base on ROS 2 topics."""
    nodes: Ros2Graph = site.needed_parts["ros2"]
    topics = base_topics(keys)
    channels = [
        TopicChannel(nodes.full_name(topic), bases.TOPIC_TYPES[word], word in bases.COMMAND_TOPICS)
        for word, topic in topics.items()
    ]
    limits = BaseLimits(keys.max_speed, keys.max_turn, keys.acceleration, keys.turn_acceleration)
    protocol = bases.Ros2BaseProtocol(
        "base", site.clock, channels, list(topics), limits, on_origin=nodes.set_origin, is_goal_active=nodes.has_goal
    )
    line = make_link("base", nodes.node, channels, site.report)
    return DiffDriveBase(line, site.clock, protocol, on_stop=nodes.stop, **settings_of(keys, site))


def ranger(keys: Ros2RangeKeys, site: DriverContext) -> Ros2Ranger:
    """Return the driver of a range finder on a ROS 2 topic."""
    nodes: Ros2Graph = site.needed_parts["ros2"]
    channel = TopicChannel(nodes.full_name(keys.scan), (LASER_SCAN,), depth=1)
    line = make_link("range", nodes.node, [channel], site.report)
    return Ros2Ranger(
        line, site.clock, channel, place=keys.place, blind=keys.blind, report=site.report, changed=site.on_change
    )


def camera(keys: Ros2CameraKeys, site: DriverContext) -> ThreadedCamera:
    """Return the driver of a camera on a ROS 2 topic."""
    nodes: Ros2Graph = site.needed_parts["ros2"]
    topic = nodes.full_name(keys.image)
    return ThreadedCamera(
        lambda: TopicFeed(nodes.node, topic, site.clock, site.report),
        site.clock,
        name="camera",
        field_of_view=keys.upright().field_of_view,
        loop=False,
        retry=0.3,
        report=site.report,
        turn=keys.orientation,
    )


def arm_joints(keys: Ros2ArmKeys) -> Mapping[str, TopicJoint]:
    """Return the joints of an arm, by name."""
    limits = keys.limits
    return {
        name: TopicJoint(joint.joint or name, limits[name], -1 if joint.reverse else 1)
        for name, joint in keys.joints.items()
    }


def head_joints(keys: Ros2HeadKeys) -> Mapping[str, TopicJoint]:
    """Return the joints of a head, each with a full turn as its limits.

    The axes of the head apply the limits and the trim of the robot file.
    """
    limits = JointLimits(-pi, pi, keys.speed)
    return {axis.joint: TopicJoint(axis.joint, limits, -1 if axis.reverse else 1) for axis in (keys.pan, keys.tilt)}


def _make_joints(
    part: str, keys: Ros2ArmKeys | Ros2HeadKeys, joints: Mapping[str, TopicJoint], site: DriverContext
) -> TopicJoints:
    nodes: Ros2Graph = site.needed_parts["ros2"]
    channels = joint_channels(keys.states, keys.command, joints, nodes.full_name)
    line = make_link(part, nodes.node, channels, site.report)
    return TopicJoints(line, site.clock, channels, joints, name=part, away=keys.away, report=site.report)


def arm(keys: Ros2ArmKeys, site: DriverContext) -> TopicJoints:
    """Return the driver of an arm on ROS 2 topics."""
    return _make_joints(site.part, keys, arm_joints(keys), site)


def joint_axis(keys: Ros2AxisKeys) -> JointAxis:
    """Return the axis of a head that is a joint of ROS 2."""
    return JointAxis(keys.joint, keys.lower, keys.upper, trim=keys.trim)


def head(keys: Ros2HeadKeys, site: DriverContext) -> Ros2Head:
    """Return the driver of a head on ROS 2 topics."""
    joints = _make_joints("head", keys, head_joints(keys), site)
    return Ros2Head(
        joints,
        site.clock,
        pan=joint_axis(keys.pan),
        tilt=joint_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=site.report,
        changed=site.on_change,
    )


def voice(keys: Ros2VoiceKeys, site: DriverContext) -> Ros2Voice:
    """Return the driver of a voice on a ROS 2 topic."""
    nodes: Ros2Graph = site.needed_parts["ros2"]
    channel = TopicChannel(nodes.full_name(keys.topic), (STRING,), is_command=True)
    line = make_link("voice", nodes.node, [channel], site.report)
    return Ros2Voice(line, site.clock, channel, usual=keys.style, report=site.report, changed=site.on_change)
