"""``mission run --ros2``: publishes a run on ROS 2 topics, for RViz, rqt and other nodes."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from math import cos, nan, sin
from queue import Empty, SimpleQueue
from threading import Event as Signal
from threading import Thread
from typing import TYPE_CHECKING, Any, Self

from drivers.api.sections import Ros2Keys
from drivers.clock import SystemClock, unix_time_ns
from drivers.errors import NotConnected
from drivers.ros2.declared import ZenohKeys
from missions.cli.origin import robot_file
from missions.cli.session import RunSession
from missions.executive.events import Ended, Event, NodeChanged, PerceptSeen, Started, Ticked, VariableSet, json_value
from missions.library.drivers import load_robot
from missions.plugins.ros2.options import Ros2Options

if TYPE_CHECKING:
    from drivers.ros2.node import Ros2Node
    from drivers.ros2.session import ZenohAccess

STRING, DETECTION_ARRAY = "std_msgs/msg/String", "vision_msgs/msg/Detection2DArray"

EVENTS_TOPIC, TREE_TOPIC, VARIABLES_TOPIC, DETECTIONS_TOPIC = (
    "/mission/events",
    "/mission/tree",
    "/mission/variables",
    "/mission/detections",
)
"""Topics on which a run is published."""

CAMERA_FRAME = "camera_optical_frame"
"""Camera frame as in REP 103: x right, y down, z ahead."""

STATE_INTERVAL = 1.0
"""Seconds between two publications of the whole tree and the variables, so that late subscribers get them."""

CONNECT_TIMEOUT = 1.0
"""Maximum seconds for which the first event waits for the connection to the router."""

MAX_QUEUED_EVENTS = 10_000
"""Maximum number of events of the run that wait to be published."""


class RunPublisher:
    """Listener that publishes a run on ROS 2 topics, on its own thread, with reconnects to the router.

    ``/mission/events`` has each event as JSON, ``/mission/tree`` the status of each node, ``/mission/variables`` the
    variables of the mission, and ``/mission/detections`` the detected faces and things.
    """

    def __init__(self, access: "ZenohAccess", domain: int) -> None:
        from drivers.ros2.graph import Ros2Graph  # noqa: PLC0415 - an extra

        self.domain = domain
        self._queue: SimpleQueue[tuple[Event, int] | None] = SimpleQueue()
        self._tree: dict[str, object] = {}
        self._nodes: dict[str, dict[str, object]] = {}
        self._variables: dict[str, object] = {}
        self._clock, self._connected = SystemClock(), Signal()
        self._graph = Ros2Graph(
            access, self._clock, Ros2Keys(), domain=domain, name="mission", report=lambda _: self._connected.set()
        )
        self._state_sent_at = -STATE_INTERVAL
        self._changed = True
        self._end_requested = False
        self._thread = Thread(target=self._run, name="announcer", daemon=True)

    def open(self) -> None:
        """Start the thread that publishes the run."""
        self._thread.start()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Publish the final state of the run, and end the thread, within two seconds."""
        self._end_requested = True
        self._queue.put(None)
        self._thread.join(2.0)

    def __call__(self, event: Event) -> None:
        """Queue an event of the run to be published; returns at once."""
        if self._queue.qsize() < MAX_QUEUED_EVENTS:
            self._queue.put((event, unix_time_ns()))

    def _run(self) -> None:
        self._graph.open()
        self._connected.wait(CONNECT_TIMEOUT)  # so that the first events are published, too
        while not (self._end_requested and self._queue.empty()):
            self._publish_next(self._node())
        if (node := self._node()) is not None:
            with suppress(NotConnected):
                self._publish_state(node)
        self._graph.close()

    def _node(self) -> "Ros2Node | None":
        """Return the ROS 2 node with its publishers; None while there is no connection to the router."""
        try:
            node = self._graph.node()
            for name in (EVENTS_TOPIC, TREE_TOPIC, VARIABLES_TOPIC):
                node.publisher(name, STRING, blocks=True)
            node.publisher(DETECTIONS_TOPIC, DETECTION_ARRAY, blocks=True)
        except NotConnected:
            return None
        return node

    def _publish_next(self, node: "Ros2Node | None") -> None:
        """Publish the next event if one comes within ``STATE_INTERVAL``, and the state of the run if it is due.

        Without a connection, ``node`` is None, and the event only updates the state.
        """
        event, heard = None, 0
        with suppress(Empty):
            event, heard = self._queue.get(timeout=STATE_INTERVAL) or (None, 0)
        if event is not None:
            self._update_state(event)
        if node is None:
            return
        with suppress(NotConnected):
            if event is not None and not isinstance(event, Ticked):
                _publish_json(node, EVENTS_TOPIC, event.as_dict())
            if isinstance(event, PerceptSeen):
                _publish(node, DETECTIONS_TOPIC, DETECTION_ARRAY, detections(event, heard))
            if self._clock.now() - self._state_sent_at >= (0.1 if self._changed else STATE_INTERVAL):
                self._publish_state(node)

    def _publish_state(self, node: "Ros2Node") -> None:
        self._state_sent_at, self._changed = self._clock.now(), False
        _publish_json(node, TREE_TOPIC, {**self._tree, "nodes": list(self._nodes.values())})
        _publish_json(node, VARIABLES_TOPIC, self._variables)

    def _update_state(self, event: Event) -> None:
        """Update the status of the nodes and the values of the variables, as they will be published, from an event."""
        self._changed = self._changed or isinstance(event, NodeChanged | VariableSet | Ended | Started)
        match event:
            case Started():
                self._tree = {"mission": event.mission, "robot": event.robot, "status": "running"}
            case NodeChanged():
                known = {"key": event.node, "name": event.name, "kind": event.kind, "line": event.line}
                self._nodes[event.node] = {**known, "status": event.status, "reason": event.reason}
            case VariableSet() if event.scope:
                self._variables[f"{event.scope}.{event.name}"] = json_value(event.value)
            case VariableSet():
                self._variables[event.name] = json_value(event.value)
            case Ended():
                self._tree |= {"status": event.result, "reason": event.reason}


def _publish_json(node: "Ros2Node", topic: str, values: Mapping[str, object]) -> None:
    _publish(node, topic, STRING, {"data": json.dumps(values, default=json_value)})


def _publish(node: "Ros2Node", topic: str, kind: str, values: Mapping[str, object]) -> None:
    from drivers.ros2.types import types  # noqa: PLC0415 - an extra

    node.publisher(topic, kind).send(types().encode(kind, values))


def detections(event: PerceptSeen, received_at: int) -> dict[str, object]:
    """Return the detections of a picture as vision_msgs; ``received_at`` is the time of the event, in ns since 1970."""

    def header(stamp: float) -> Mapping[str, object]:
        taken = received_at - round(1e9 * (event.t - stamp))
        return {"stamp": {"sec": taken // 10**9, "nanosec": taken % 10**9}, "frame_id": CAMERA_FRAME}

    kinds: dict[str, Any] = {"face": event.faces, "thing": event.things or (), "marker": event.markers or ()}
    found = [{"header": header(told["stamp"]), **_detection(kind, told)} for kind in kinds for told in kinds[kind]]
    return {"header": header(event.stamp), "detections": found}


def _detection(kind: str, percept: Any) -> Mapping[str, object]:
    """Return a detection: class, box in pixels, and position, which is NaN if the distance is unknown."""
    named = percept.get("name") or percept.get("colour") or percept.get("number", "")
    x, y, width, height = percept["box"]
    bearing, down, away = (
        percept["bearing"],
        percept["elevation"],
        nan if percept["distance"] is None else percept["distance"],
    )
    at = {"x": -away * cos(down) * sin(bearing), "y": away * sin(down), "z": away * cos(down) * cos(bearing)}
    hypothesis = {"class_id": f"{kind}:{named}" if named != "" else kind, "score": 1.0}
    centre = {"position": {"x": x + width / 2, "y": y + height / 2}}
    return {
        "results": [{"hypothesis": hypothesis, "pose": {"pose": {"position": at, "orientation": {"w": 1.0}}}}],
        "bbox": {"center": centre, "size_x": width, "size_y": height},
        "id": str(percept["id"]),
    }


def make_run_publisher(robot: str | None, router: str | None, domain: int | None = None) -> RunPublisher:
    """Return the publisher for a robot; ``router`` and ``domain`` replace those in its file, if given."""
    from drivers.ros2.make import ros_domain  # noqa: PLC0415 - an extra
    from drivers.ros2.session import zenoh_access  # noqa: PLC0415

    section = load_robot(robot_file(robot)).sections.get("ros2")
    keys = ZenohKeys() if section is None else section.keys
    return RunPublisher(zenoh_access(keys, router or ""), ros_domain(keys) if domain is None else domain)


@contextmanager
def publish_run(options: Ros2Options, session: RunSession) -> Iterator[None]:
    """Publish a run to ROS 2 within the context."""
    request = session.request
    with make_run_publisher(request.robot, options.ros2_router, request.ros2_domain) as announcer:
        session.listen(announcer)
        yield
