"""The nodes of ROS 2 that a robot is made of: one session of Zenoh, opened and found again on a thread of its own."""

import json
from collections.abc import Callable
from math import cos, sin
from threading import Event, RLock
from typing import Any

from drivers.api import DeviceStatus, Health, Pose2D, Progress, Quality, Reading, Report, ignore
from drivers.api.ros2 import START, Place
from drivers.api.sections import Ros2Keys
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.ros2 import wire
from drivers.ros2.node import Node
from drivers.ros2.requests import Requests
from drivers.ros2.session import Access, Transports, open_session
from drivers.ros2.types import Malformed, types
from drivers.ros2.wire import SEND
from drivers.transport.loop import ThreadLoop, guarded

RETRY = 0.3
"""Seconds until a router that did not answer is tried again."""

LOOK = 0.1
"""Seconds between two looks at who is there."""

STALE_AFTER = 2.0
"""Seconds after which the newest message of a topic counts as old."""

TF = "tf2_msgs/msg/TFMessage"

TO_POSE, THROUGH = "nav2_msgs/action/NavigateToPose", "nav2_msgs/action/NavigateThroughPoses"


class Ros2Graph:
    """A ``drivers.api.Ros2`` by ``access`` to a router of Zenoh, in a ``domain``. Other parts of the robot stand on it.

    ``changed`` is called, from threads of Zenoh's, when something asked for has come further.
    """

    name = "ros2"

    def __init__(
        self,
        access: Access,
        clock: Clock,
        keys: Ros2Keys,
        *,
        domain: int,
        name: str = "missiontree",
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.keys = keys
        self._access, self._clock, self._domain, self._called = access, clock, domain, name
        self._report, self._changed = guarded(report), guarded(changed)
        self._lock = RLock()
        self._session: Any = None
        self._node: Node | None = None
        self._transports: Transports | None = None
        self._lost = Event()
        self._trouble: NotConnected | None = NotConnected("ros2: not opened yet")
        self._sessions = self._malformed = 0
        self._requests = Requests(self.node, clock, self._changed)
        self._watched: dict[str, Node] = {}
        self._newest: dict[str, tuple[str, bytes, float]] = {}
        self._read: dict[str, tuple[float, str]] = {}
        self._start: tuple[Pose2D, str] = (Pose2D(0.0, 0.0, 0.0), "odom")
        self._loop = ThreadLoop("ros2", self._turn, self._finish)

    # --- what other parts stand on ------------------------------------------------------------------------------------

    def node(self, who: str = "ros2") -> Node:
        """Return the node. Raises NotConnected while there is none."""
        node, trouble = self._node, self._trouble
        if node is None:
            what = str(trouble or "").removeprefix("ros2: ")
            raise NotConnected(f"{who}: {what}", hint="" if trouble is None else trouble.hint)
        return node

    def full(self, topic: str) -> str:
        """Return the whole name of a topic. Raises BadRequest for what no topic is called."""
        try:
            return wire.whole(topic, self.keys.namespace)
        except ValueError as error:
            raise BadRequest(f"ros2: {error}", hint=wire.NAMES) from error

    def anchor(self, start: Pose2D, frame: str) -> None:
        """Note where in the robot's odometry its pose is 0."""
        self._start = start, frame or "odom"

    # --- drivers.api.Ros2 ---------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start looking for the router; returns at once, whether it is there or not."""
        self._loop.start()

    def rest(self) -> None:
        """Cancel what was begun."""
        self.stop()

    def close(self) -> None:
        """Cancel what was begun, end the thread, and the session. Safe from any state, more than once."""
        self._loop.end()

    def health(self) -> Health:
        """Say whether the router is there, and how many nodes."""
        node, trouble = self._node, self._trouble
        counters = {"sessions": self._sessions, "malformed": self._malformed}
        if node is None:
            told = trouble or NotConnected("ros2: the router has gone")
            return Health(False, str(told), told.hint, counters)
        return Health(True, counters={**counters, "nodes": self.nodes()})

    def nodes(self) -> int:
        """Return how many nodes there are besides ours."""
        return 0 if self._node is None else len(self._node.entities(wire.NODE))

    def offers(self, name: str) -> bool:
        """Whether there is an action, a service or a topic of this name now."""
        node, full = self._node, self.full(name)
        if node is None:
            return False
        return self.does(name) or any(node.entities(role, full) for role in (wire.SERVER, wire.PUBLISHER))

    def does(self, action: str) -> bool:
        """Whether there is an action of this name now."""
        node = self._node
        return node is not None and bool(node.entities(wire.SERVER, f"{self.full(action)}/{SEND}"))

    def navigates(self) -> bool:
        """Whether there is Nav2 to drive by."""
        return self.does(self.keys.navigation)

    def latest(self, topic: str) -> Reading[str]:
        """Return the newest message of a topic as JSON; it is heard from when it is first asked for.

        Of a latched topic that is what was sent last, whenever that was; it holds as long as its sender is there.
        """
        now, name = self._clock.now(), self.full(topic)
        node = self._node
        if node is not None and self._watched.get(name) is not node:
            self._watch(name, node)
        newest = self._newest.get(name)
        if newest is None:
            return Reading(None, now, Quality.NONE)
        kind, payload, stamp = newest
        read = self._read.get(name)
        if read is None or read[0] != stamp:
            try:
                read = stamp, json.dumps(types().values(types().decode(kind, payload)))
            except Malformed as error:
                self._malformed += 1
                read = stamp, ""
                if node is not None:
                    node.faults.add_of(name, error)
            self._read[name] = read
        if not read[1]:
            return Reading(None, now, Quality.NONE)
        lasts = now - stamp <= STALE_AFTER or (node is not None and node.latched(name))
        return Reading(read[1], stamp, Quality.GOOD if lasts else Quality.STALE)

    def progress(self, number: int) -> Progress:
        """Return how far a request has come."""
        return self._requests.progress(number)

    def publish(self, topic: str, kind: str, values: str) -> None:
        """Send a message. Raises BadRequest, NotConnected."""
        name, node = self.full(topic), self.node()
        listening = [each for each in node.entities(wire.SUBSCRIBER, name) if kind in {"", each.kind}]
        kind = kind or (listening[0].kind if listening else "")
        if not kind:
            raise NotConnected(f"ros2: nobody listens to {name}, so its type is not known", hint="give 'type'")
        payload = types().encode(kind, json.loads(values or "{}"))
        for digest in {each.digest for each in listening if each.kind == kind} or {""}:
            node.publisher(name, kind, digest).send(payload)

    def call(self, service: str, kind: str, values: str) -> int:
        """Ask a service."""
        return self._requests.call(self.full(service), kind, values)

    def begin(self, action: str, kind: str, goal: str) -> int:
        """Begin an action."""
        return self._requests.begin(self.full(action), kind, json.loads(goal or "{}"))

    def navigate(self, places: tuple[Place, ...], frame: str) -> int:
        """Have Nav2 drive to the last of the places, through the others."""
        poses = [self._stamped(each, frame) for each in places]
        if len(poses) == 1:
            return self._requests.begin(self.full(self.keys.navigation), TO_POSE, {"pose": poses[0]})
        return self._requests.begin(self.full(self.keys.through), THROUGH, {"poses": poses})

    def cancel(self, number: int) -> None:
        """Cancel an action."""
        self._requests.cancel(number)

    def has_goal(self) -> bool:
        """Return whether an action that was begun here may still be under way."""
        return self._requests.has_goal()

    def stop(self) -> None:
        """Cancel all actions."""
        self._requests.cancel_all()

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _turn(self) -> float:
        if self._session is not None and self._lost.is_set():
            self._drop()
            self._tell("offline", "the router has gone", "is it still running, and the network there?")
        if self._session is None:
            return self._connect()
        self._requests.look(self._node)
        return LOOK

    def _connect(self) -> float:
        try:
            types()  # whose loading takes a while, and is not to be done in a tick
            session = open_session(self.name, self._access)
            self._lost.clear()
            transports = Transports(session, self._gone)
            keys = self.keys
            node = Node(
                session,
                self._clock,
                domain=self._domain,
                namespace=keys.namespace,
                name=self._called,
                report=self._report,
            )
        except NotConnected as error:
            self._trouble = error
            self._requests.look(None)
            return RETRY
        self._session, self._transports, self._sessions = session, transports, self._sessions + 1
        self._trouble, self._node = None, node
        self._tell("online", f"{', '.join(self._access.endpoints)}: connected", "")
        return 0.0

    def _gone(self) -> None:
        self._lost.set()
        node = self._node
        if node is not None:
            node.lost = True
        self._loop.wake()

    def _drop(self) -> None:
        session, node = self._session, self._node
        self._trouble = NotConnected("ros2: the router has gone", hint="is it still running, and the network there?")
        self._session = self._node = self._transports = None
        if node is not None:
            node.lost = True
        if session is not None:
            try:
                session.close()
            except Exception as error:  # of the session: it is given up anyhow
                self._tell("fault", f"the session did not close: {error}", "")

    def _finish(self) -> None:
        self._requests.cancel_all()
        node = self._node
        if node is not None:
            node.close()
        self._drop()

    def _tell(self, kind: str, what: str, hint: str) -> None:
        self._report(DeviceStatus(self.name, kind, what, hint))

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _watch(self, name: str, node: Node) -> None:
        """Listen to a topic from now on, with the types that its senders have."""
        sent = {each.kind for each in node.entities(wire.PUBLISHER, name)}
        kinds = {kind for kind in sent if types().knows(kind)}
        if not kinds:
            if sent:
                node.faults.add_of(name, f"its type {' or '.join(sorted(sent))} is not known here")
            return
        self._watched[name] = node

        def heard(kind: str, payload: bytes) -> None:
            self._newest[name] = kind, payload, self._clock.now()
            self._changed()

        node.subscribe(name, kinds, heard)

    def _stamped(self, place: Place, frame: str) -> dict[str, object]:
        x, y, heading = place
        if frame == START:
            start, frame = self._start
            turn = start.heading
            x, y = start.x + x * cos(turn) - y * sin(turn), start.y + x * sin(turn) + y * cos(turn)
            heading += turn
        turned = {"z": sin(heading / 2), "w": cos(heading / 2)}
        return {"header": {"frame_id": frame}, "pose": {"position": {"x": x, "y": y}, "orientation": turned}}
