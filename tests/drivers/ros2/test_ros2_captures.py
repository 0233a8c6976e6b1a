"""What robots have said, as `mission ros2 capture` wrote it, told to the drivers once more.

Each file of ``captures`` is that of a robot: `NAME.jsonl` for the robot file NAME. What is in it now comes from
`mission simulate --ros2`, of which a mission drove the robot.
"""

import base64
import json
from collections.abc import Iterable, Sequence
from math import dist
from pathlib import Path
from typing import Any

import pytest

from config.library import find_file
from config.robot import RobotConfig
from drivers.api import BaseLimits
from drivers.api.driver import DriverContext
from drivers.base.arbitrated import settings_of
from drivers.base.diff_drive import DiffDriveBase
from drivers.ros2 import wire
from drivers.ros2.base import COMMAND_TOPICS, TOPIC_TYPES, Ros2BaseProtocol
from drivers.ros2.declared import Ros2BaseKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.make import base_topics
from drivers.ros2.ranger import LASER_SCAN, Ros2Ranger
from drivers.ros2.topic_port import TopicChannel
from drivers.ros2.types import types
from drivers.ros2.virtual_topics import VirtualTopics
from drivers.sim.timeline import Timeline
from missions.library.drivers import load_robot
from tests.drivers.cranked import HandWire

FILES = sorted((Path(__file__).parent / "captures").glob("*.jsonl"))


class Captured(VirtualTopics):
    """Says on the ``channels`` of a part what was captured, and when; who is there, the tokens say."""

    def __init__(self, lines: Sequence[dict[str, Any]], channels: Sequence[TopicChannel]) -> None:
        super().__init__(channels)
        found = [wire.parse_entity(line["token"]) for line in lines if "token" in line]
        there = {(each.role, each.name, each.kind) for each in found if each is not None}
        roles = [wire.SUBSCRIBER if each.is_command else wire.PUBLISHER for each in channels]
        self.kinds = [
            next((kind for kind in each.kinds if (role, each.topic, kind) in there), "")
            for role, each in zip(roles, channels, strict=True)
        ]
        numbers = {each.topic: number for number, each in enumerate(channels) if not each.is_command}
        self.due = [
            (line["t"], numbers[line["topic"]], base64.b64decode(line["payload"]))
            for line in lines
            if line.get("topic") in numbers
        ]
        self.said = 0

    def _kind(self, channel: int) -> str:
        return self.kinds[channel]

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        while self.said < len(self.due) and self.due[self.said][0] <= now:
            self.said += 1
            yield self.due[self.said - 1][1:]

    def told(self, topic: str) -> list[Any]:
        """Return the messages of a topic."""
        number = next(number for number, each in enumerate(self.channels) if each.topic == topic)
        return [types().decode(self.kinds[number], data) for _, which, data in self.due if which == number]


@pytest.fixture(params=FILES, ids=lambda file: file.stem)
def robot(request: pytest.FixtureRequest) -> tuple[RobotConfig, list[dict[str, Any]]]:
    """A robot file, and what was captured of that robot."""
    lines = [json.loads(line) for line in request.param.read_text(encoding="utf-8").splitlines()]
    return load_robot(find_file("robots", request.param.stem)), lines


def full(config: RobotConfig, topic: str) -> str:
    nodes = config.keys(ZenohKeys)
    return wire.full_name(topic, "" if nodes is None else nodes.namespace)


def test_recorded_tokens_are_parsed_and_contain_no_session(robot: tuple[RobotConfig, list[dict[str, Any]]]) -> None:
    tokens = [line["token"] for line in robot[1] if "token" in line]
    for token in tokens:
        entity = wire.parse_entity(token)
        assert entity is not None, token
        assert entity.token == token
        assert int(entity.zid, 16) < 1000, "scrubbed"


def test_base_follows_recorded_odometry(robot: tuple[RobotConfig, list[dict[str, Any]]]) -> None:
    config, lines = robot
    keys, timeline = config.keys(Ros2BaseKeys), Timeline()
    assert keys is not None
    topics = base_topics(keys)
    channels = [
        TopicChannel(full(config, topic), TOPIC_TYPES[word], word in COMMAND_TOPICS) for word, topic in topics.items()
    ]
    said = Captured(lines, channels)
    link = HandWire(said, timeline).link("base")
    limits = BaseLimits(keys.max_speed, keys.max_turn, keys.acceleration, keys.turn_acceleration)
    protocol = Ros2BaseProtocol("base", timeline.clock, channels, list(topics), limits)
    base = DiffDriveBase(link, timeline.clock, protocol, **settings_of(keys, DriverContext(timeline.clock)))
    base.open()
    timeline.run_until(said.due[-1][0] + 0.05)
    health, state, told = base.health(), base.state().value, said.told(full(config, keys.odom))
    assert (health.online, health.detail) == (True, "")
    assert (health.counters["malformed"], health.counters["reports"]) == (0, len(told))
    assert state is not None
    first, last = (each.pose.pose.position for each in (told[0], told[-1]))
    assert dist((0.0, 0.0), (state.pose.x, state.pose.y)) == pytest.approx(dist((first.x, first.y), (last.x, last.y)))
    assert state.velocity.linear == told[-1].twist.twist.linear.x
    base.close()


def test_range_finder_reports_the_recorded_ranges(robot: tuple[RobotConfig, list[dict[str, Any]]]) -> None:
    config, lines = robot
    keys, timeline = config.keys(Ros2RangeKeys), Timeline()
    assert keys is not None
    channel = TopicChannel(full(config, keys.scan), (LASER_SCAN,), depth=1)
    said = Captured(lines, [channel])
    link = HandWire(said, timeline).link("range")
    ranger = Ros2Ranger(link, timeline.clock, channel, place=keys.place, blind=keys.blind)
    ranger.open()
    timeline.run_until(said.due[-1][0] + 0.05)
    scan, told = ranger.scan(), said.told(channel.topic)
    assert scan.good
    assert scan.value is not None
    assert len(scan.value.ranges) == len(told[-1].ranges)
    assert scan.value.nearest() == pytest.approx(min(each for each in told[-1].ranges if each >= told[-1].range_min))
    ranger.close()
