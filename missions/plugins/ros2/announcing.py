"""``mission run --ros2``: tells ROS 2 how a run goes, as topics for RViz, rqt and nodes of one's own."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from math import cos, nan, sin
from queue import Empty, SimpleQueue
from threading import Event as Signal
from threading import Thread
from typing import TYPE_CHECKING, Any, Self

from drivers.api.sections import Ros2Keys
from drivers.clock import SystemClock, since_1970
from drivers.errors import NotConnected
from drivers.ros2.declared import ZenohKeys
from missions.cli.origin import robot_file
from missions.cli.session import RunSession
from missions.executive.events import Ended, Event, NodeChanged, PerceptSeen, Started, Ticked, VariableSet, plain
from missions.library.drivers import load_robot
from missions.plugins.ros2.options import Ros2Options

if TYPE_CHECKING:
    from drivers.ros2.node import Node
    from drivers.ros2.session import Access

STRING, DETECTIONS = "std_msgs/msg/String", "vision_msgs/msg/Detection2DArray"

EVENTS, TREE, VARIABLES, SEEN = "/mission/events", "/mission/tree", "/mission/variables", "/mission/detections"
"""The topics on which a run is told."""

FRAME = "camera_optical_frame"
"""The frame of what is seen, as REP 103 has those of cameras: x right, y down, z ahead."""

AGAIN = 1.0
"""Seconds after which the whole tree and the variables are told again: who has come later has missed them."""

PATIENCE = 1.0
"""Seconds for which the first event waits for the router."""

MOST_WAITING = 10_000
"""Events that wait to be told at most."""


class Announcer:
    """A listener that tells a run on topics of ROS 2, from a thread of its own; a router that is away is looked for.

    ``/mission/events`` has each event as JSON, ``/mission/tree`` the status of each node, ``/mission/variables`` those
    of the mission, and ``/mission/detections`` the faces and things that are seen.
    """

    def __init__(self, access: "Access", domain: int) -> None:
        from drivers.ros2.graph import Ros2Graph  # noqa: PLC0415 - an extra

        self.domain = domain
        self._waiting: SimpleQueue[tuple[Event, int] | None] = SimpleQueue()
        self._tree: dict[str, object] = {}
        self._nodes: dict[str, dict[str, object]] = {}
        self._variables: dict[str, object] = {}
        self._clock, self._connected = SystemClock(), Signal()
        self._graph = Ros2Graph(
            access, self._clock, Ros2Keys(), domain=domain, name="mission", report=lambda _: self._connected.set()
        )
        self._told_at = -AGAIN
        self._changed = True
        self._ending = False
        self._thread = Thread(target=self._run, name="announcer", daemon=True)

    def open(self) -> None:
        """Start the thread."""
        self._thread.start()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Tell the last, and end the thread: it has two seconds for that."""
        self._ending = True
        self._waiting.put(None)
        self._thread.join(2.0)

    def __call__(self, event: Event) -> None:
        """Take an event; returns at once."""
        if self._waiting.qsize() < MOST_WAITING:
            self._waiting.put((event, since_1970()))

    def _run(self) -> None:
        self._graph.open()
        self._connected.wait(PATIENCE)  # what comes first is told, too
        while not (self._ending and self._waiting.empty()):
            self._take(self._node())
        if (node := self._node()) is not None:
            with suppress(NotConnected):
                self._tell_state(node)
        self._graph.close()

    def _node(self) -> "Node | None":
        """Return the node to tell by; None while the router is away."""
        try:
            node = self._graph.node()
            for name in (EVENTS, TREE, VARIABLES):
                node.publisher(name, STRING, waits=True)
            node.publisher(SEEN, DETECTIONS, waits=True)
        except NotConnected:
            return None
        return node

    def _take(self, node: "Node | None") -> None:
        """Take an event, if one comes, and tell it; and now and then how all stands."""
        event, heard = None, 0
        with suppress(Empty):
            event, heard = self._waiting.get(timeout=AGAIN) or (None, 0)
        if event is not None:
            self._note(event)
        if node is None:
            return
        with suppress(NotConnected):
            if event is not None and not isinstance(event, Ticked):
                _say(node, EVENTS, event.as_dict())
            if isinstance(event, PerceptSeen):
                _send(node, SEEN, DETECTIONS, detections(event, heard))
            if self._clock.now() - self._told_at >= (0.1 if self._changed else AGAIN):
                self._tell_state(node)

    def _tell_state(self, node: "Node") -> None:
        self._told_at, self._changed = self._clock.now(), False
        _say(node, TREE, {**self._tree, "nodes": list(self._nodes.values())})
        _say(node, VARIABLES, self._variables)

    def _note(self, event: Event) -> None:
        """Take into the whole what an event says."""
        self._changed = self._changed or isinstance(event, NodeChanged | VariableSet | Ended | Started)
        match event:
            case Started():
                self._tree = {"mission": event.mission, "robot": event.robot, "status": "running"}
            case NodeChanged():
                known = {"key": event.node, "name": event.name, "kind": event.kind, "line": event.line}
                self._nodes[event.node] = {**known, "status": event.status, "reason": event.reason}
            case VariableSet() if event.scope:
                self._variables[f"{event.scope}.{event.name}"] = plain(event.value)
            case VariableSet():
                self._variables[event.name] = plain(event.value)
            case Ended():
                self._tree |= {"status": event.result, "reason": event.reason}


def _say(node: "Node", topic: str, values: Mapping[str, object]) -> None:
    _send(node, topic, STRING, {"data": json.dumps(values, default=plain)})


def _send(node: "Node", topic: str, kind: str, values: Mapping[str, object]) -> None:
    from drivers.ros2.types import types  # noqa: PLC0415 - an extra

    node.publisher(topic, kind).send(types().encode(kind, values))


def detections(event: PerceptSeen, heard: int) -> dict[str, object]:
    """Return what a picture shows as vision_msgs has it; ``heard`` is when the event was told, in ns since 1970."""

    def header(stamp: float) -> Mapping[str, object]:
        taken = heard - round(1e9 * (event.t - stamp))
        return {"stamp": {"sec": taken // 10**9, "nanosec": taken % 10**9}, "frame_id": FRAME}

    kinds: dict[str, Any] = {"face": event.faces, "thing": event.things or (), "marker": event.markers or ()}
    found = [{"header": header(told["stamp"]), **_detection(kind, told)} for kind in kinds for told in kinds[kind]]
    return {"header": header(event.stamp), "detections": found}


def _detection(kind: str, told: Any) -> Mapping[str, object]:
    """Return a percept: its class, its box in pixels, and where it is, which is not a number where that is unknown."""
    named = told.get("name") or told.get("colour") or told.get("number", "")
    x, y, width, height = told["box"]
    bearing, down, away = told["bearing"], told["elevation"], nan if told["distance"] is None else told["distance"]
    at = {"x": -away * cos(down) * sin(bearing), "y": away * sin(down), "z": away * cos(down) * cos(bearing)}
    hypothesis = {"class_id": f"{kind}:{named}" if named != "" else kind, "score": 1.0}
    centre = {"position": {"x": x + width / 2, "y": y + height / 2}}
    return {
        "results": [{"hypothesis": hypothesis, "pose": {"pose": {"position": at, "orientation": {"w": 1.0}}}}],
        "bbox": {"center": centre, "size_x": width, "size_y": height},
        "id": str(told["id"]),
    }


def announcer_of(robot: str | None, router: str | None, domain: int | None = None) -> Announcer:
    """Return the announcer for a robot: by the router and in the domain of its file, or those that are named."""
    from drivers.ros2.make import domain_of  # noqa: PLC0415 - an extra
    from drivers.ros2.session import access_of  # noqa: PLC0415

    section = load_robot(robot_file(robot)).sections.get("ros2")
    keys = ZenohKeys() if section is None else section.keys
    return Announcer(access_of(keys, router or ""), domain_of(keys) if domain is None else domain)


@contextmanager
def announce(options: Ros2Options, session: RunSession) -> Iterator[None]:
    """Tell ROS 2 of a run."""
    request = session.request
    with announcer_of(request.robot, options.ros2_router, request.ros2_domain) as announcer:
        session.listen(announcer)
        yield
