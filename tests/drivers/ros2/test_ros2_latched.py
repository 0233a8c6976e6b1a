"""Topics whose last message is kept for who comes later, as `rmw_zenoh` keeps it: /map, /robot_description."""

import json
import secrets
from collections.abc import Iterator
from typing import Any

import pytest
from zenoh import ext

from drivers.api.driver import DriverContext
from drivers.clock import SystemClock, unix_time_ns
from drivers.ros2 import wire
from drivers.ros2.declared import ZenohKeys
from drivers.ros2.make import graph as make_graph
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.types import types
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, free_address
from tests.missions.command import command
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

STRING = "std_msgs/msg/String"


class Sender:
    """Sends on a topic that is reliable and transient local, depth 1, as rcl has `rmw_zenoh` declare it."""

    def __init__(self, router: str, name: str) -> None:
        self.session: Any = open_session("sender", ZenohAccess((router,)), timeout=5.0)
        zid = str(self.session.zid())
        its = wire.Entity("MP", 0, zid, "0", "1", "publisher", "", name, STRING, types().digest(STRING), ":1:,1:,:,:,,")
        self._token = self.session.liveliness().declare_token(its.token)
        missing: Any = ext.MissDetectionConfig  # whose stub asks for both of two that exclude each other
        self._publisher: Any = ext.declare_advanced_publisher(
            self.session,
            its.key,
            cache=ext.CacheConfig(1),
            publisher_detection=True,
            sample_miss_detection=missing(sporadic_heartbeat=5.0),
        )
        self._number, self._gid = 0, secrets.token_bytes(16)

    def send(self, text: str, *, ago: float = 0.0) -> None:
        self._number += 1
        attached = wire.Attachment(self._number, unix_time_ns() - round(ago * 1e9), self._gid).pack()
        self._publisher.put(types().encode(STRING, {"data": text}), attachment=attached)

    def close(self) -> None:
        self.session.close()


@pytest.fixture
def router() -> Iterator[str]:
    terminal = Ros2Terminal(RouterSettings(0, "", free_address()), SystemClock())
    terminal.open()
    yield terminal.path
    terminal.close()


def test_late_subscriber_receives_the_latched_message(router: str, capsys: pytest.CaptureFixture[str]) -> None:
    sender = Sender(router, "/robot_description")
    for text in ("<robot/>", "<robot name='newest'/>"):
        sender.send(text, ago=60.0)
    told = command(capsys, "ros2", "echo", "/robot_description", "--seconds", "1", "--router", router)
    assert [json.loads(line) for line in told.out.splitlines()] == [{"data": "<robot name='newest'/>"}]
    sender.close()


def test_latched_message_is_good_while_its_sender_is_online(router: str) -> None:
    clock = SystemClock()
    graph = make_graph(ZenohKeys(router=router, domain=0), DriverContext(clock))
    graph.open()
    sender = Sender(router, "/map")
    sender.send("old", ago=3600.0)
    wait_until(lambda: graph.latest("/map").value == '{"data": "old"}')
    assert graph.latest("/map").good
    sender.send("new")
    wait_until(lambda: graph.latest("/map").value == '{"data": "new"}')
    asked = graph.latest("/map").stamp
    wait_until(lambda: clock.now() - asked > 2.1)
    assert graph.latest("/map").good, "nothing newer was sent, so it holds"
    sender.close()
    wait_until(lambda: not graph.latest("/map").good)
    again = Sender(router, "/map")
    again.send("again")
    wait_until(lambda: graph.latest("/map").value == '{"data": "again"}' and graph.latest("/map").good)
    again.close()
    graph.close()


def test_token_tells_whether_a_topic_is_latched() -> None:
    kept = {":1:,1:,:,:,,": True, ":1:,10:,:,:,,": True, "1:1:1,1:0,0:0,0:1,0,0": True}
    for qos, latched in {**kept, wire.DEFAULT_QOS: False, "2:2:1,5:0,0:0,0:1,0,0": False, "": False}.items():
        token = wire.Entity("MP", 0, "ab", "0", "1", "node", "", "/map", STRING, "RIHS01_00", qos).token
        found = wire.parse_entity(token)
        assert found is not None
        assert found.is_latched is latched
