"""ROS 2 nodes of a robot: one Zenoh session, opened and reconnected on its own thread."""

import json
from collections.abc import Callable
from math import cos, sin
from threading import Event, RLock
from typing import Any

from drivers.api import DeviceStatus, Health, Pose2D, Progress, Quality, Reading, StatusCallback, ignore
from drivers.api.ros2 import START_FRAME, MapPose
from drivers.api.sections import Ros2Keys
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.ros2 import wire
from drivers.ros2.node import Ros2Node
from drivers.ros2.requests import RequestTracker
from drivers.ros2.session import ConnectionMonitor, ZenohAccess, open_session
from drivers.ros2.types import MalformedMessage, types
from drivers.ros2.wire import SEND
from drivers.transport.loop import ThreadLoop, guard_callback

RETRY_INTERVAL = 0.3
"""Seconds between attempts to connect to a Zenoh router."""

POLL_INTERVAL = 0.1
"""Seconds between two checks whether the servers of active requests still exist."""

STALE_AFTER = 2.0
"""Seconds after which the newest message of a topic is stale."""

TF = "tf2_msgs/msg/TFMessage"

NAVIGATE_TO_POSE, NAVIGATE_THROUGH_POSES = "nav2_msgs/action/NavigateToPose", "nav2_msgs/action/NavigateThroughPoses"


class Ros2Graph:
    """ROS 2 of a robot: a ``drivers.api.Ros2`` by ``access`` to a Zenoh router; shared by the robot's other parts.

    ``keys`` is the ``ros2`` section of the robot file, ``domain`` the ROS domain, ``name`` the name of our node.
    ``changed`` is called, on threads of Zenoh, after each new message and each progress of a request.
    """

    name = "ros2"

    def __init__(
        self,
        access: ZenohAccess,
        clock: Clock,
        keys: Ros2Keys,
        *,
        domain: int,
        name: str = "missiontree",
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.keys = keys
        self._access, self._clock, self._domain, self._node_name = access, clock, domain, name
        self._report, self._changed = guard_callback(report), guard_callback(changed)
        self._lock = RLock()
        self._session: Any = None
        self._node: Ros2Node | None = None
        self._transports: ConnectionMonitor | None = None
        self._disconnected = Event()
        self._error: NotConnected | None = NotConnected("ros2: not opened yet")
        self._session_count = self._malformed_count = 0
        self._requests = RequestTracker(self.node, clock, self._changed)
        self._subscriptions: dict[str, Ros2Node] = {}
        self._latest_messages: dict[str, tuple[str, bytes, float]] = {}
        self._decoded: dict[str, tuple[float, str]] = {}
        self._origin: tuple[Pose2D, str] = (Pose2D(0.0, 0.0, 0.0), "odom")
        self._loop = ThreadLoop("ros2", self._run_once, self._finish)

    # --- what other parts stand on ------------------------------------------------------------------------------------

    def node(self, part: str = "ros2") -> Ros2Node:
        """Return our own ROS 2 node. Raises NotConnected while there is none; ``part`` is the name in the message."""
        node, trouble = self._node, self._error
        if node is None:
            what = str(trouble or "").removeprefix("ros2: ")
            raise NotConnected(f"{part}: {what}", hint="" if trouble is None else trouble.hint)
        return node

    def full_name(self, topic: str) -> str:
        """Return the full name of a topic. Raises BadRequest for an invalid name."""
        try:
            return wire.full_name(topic, self.keys.namespace)
        except ValueError as error:
            raise BadRequest(f"ros2: {error}", hint=wire.NAME_HINT) from error

    def set_origin(self, start: Pose2D, frame: str) -> None:
        """Set the pose ``start`` in the odometry ``frame`` at which the base's pose is 0, for goals of Nav2."""
        self._origin = start, frame or "odom"

    # --- drivers.api.Ros2 ---------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start connecting to the router; returns at once."""
        self._loop.start()

    def rest(self) -> None:
        """Cancel all actions that were started by this object."""
        self.stop()

    def close(self) -> None:
        """Cancel all actions, end the thread and the session. Safe from any state, more than once."""
        self._loop.end()

    def health(self) -> Health:
        """Return whether the router is connected, with the number of nodes."""
        node, trouble = self._node, self._error
        counters = {"sessions": self._session_count, "malformed": self._malformed_count}
        if node is None:
            told = trouble or NotConnected("ros2: the router is gone")
            return Health(False, str(told), told.hint, counters)
        return Health(True, counters={**counters, "nodes": self.nodes()})

    def nodes(self) -> int:
        """Return the number of other ROS 2 nodes."""
        return 0 if self._node is None else len(self._node.entities(wire.NODE))

    def offers(self, name: str) -> bool:
        """Return True if an action, a service or a topic of this name exists now."""
        node, full = self._node, self.full_name(name)
        if node is None:
            return False
        return self.does(name) or any(node.entities(role, full) for role in (wire.SERVER, wire.PUBLISHER))

    def does(self, action: str) -> bool:
        """Return True if an action of this name exists now."""
        node = self._node
        return node is not None and bool(node.entities(wire.SERVER, f"{self.full_name(action)}/{SEND}"))

    def navigates(self) -> bool:
        """Return True if Nav2 is available."""
        return self.does(self.keys.navigation)

    def latest(self, topic: str) -> Reading[str]:
        """Return the newest message of a topic as JSON; the first call for a topic subscribes to it.

        Without a message the value is None. The last message of a latched topic stays valid as long as its publisher
        exists.
        """
        now, name = self._clock.now(), self.full_name(topic)
        node = self._node
        if node is not None and self._subscriptions.get(name) is not node:
            self._subscribe(name, node)
        newest = self._latest_messages.get(name)
        if newest is None:
            return Reading(None, now, Quality.NONE)
        kind, payload, stamp = newest
        read = self._decoded.get(name)
        if read is None or read[0] != stamp:
            try:
                read = stamp, json.dumps(types().to_plain(types().decode(kind, payload)))
            except MalformedMessage as error:
                self._malformed_count += 1
                read = stamp, ""
                if node is not None:
                    node.faults.add_for_topic(name, error)
            self._decoded[name] = read
        if not read[1]:
            return Reading(None, now, Quality.NONE)
        lasts = now - stamp <= STALE_AFTER or (node is not None and node.is_latched(name))
        return Reading(read[1], stamp, Quality.GOOD if lasts else Quality.STALE)

    def progress(self, number: int) -> Progress:
        """Return the progress of the request ``number``, which ``call``, ``begin`` or ``navigate`` returned."""
        return self._requests.progress(number)

    def publish(self, topic: str, kind: str, values: str) -> None:
        """Publish a message. Raises BadRequest, NotConnected."""
        name, node = self.full_name(topic), self.node()
        listening = [each for each in node.entities(wire.SUBSCRIBER, name) if kind in {"", each.kind}]
        kind = kind or (listening[0].kind if listening else "")
        if not kind:
            raise NotConnected(f"ros2: no subscriber of {name}, so its type is unknown", hint="give 'type'")
        payload = types().encode(kind, json.loads(values or "{}"))
        for digest in {each.digest for each in listening if each.kind == kind} or {""}:
            node.publisher(name, kind, digest).send(payload)

    def call(self, service: str, kind: str, values: str) -> int:
        """Call a service of type ``kind`` with ``values`` (JSON); return the number of the request."""
        return self._requests.call(self.full_name(service), kind, values)

    def begin(self, action: str, kind: str, goal: str) -> int:
        """Send a goal (JSON) to an action of type ``kind``; return the number of the request."""
        return self._requests.begin(self.full_name(action), kind, json.loads(goal or "{}"))

    def navigate(self, places: tuple[MapPose, ...], frame: str) -> int:
        """Let Nav2 drive the robot to the last of ``places``, through the others; return the number of the request.

        ``frame`` is the frame of the places, such as ``map``.
        """
        poses = [self._pose_stamped(each, frame) for each in places]
        if len(poses) == 1:
            return self._requests.begin(self.full_name(self.keys.navigation), NAVIGATE_TO_POSE, {"pose": poses[0]})
        return self._requests.begin(self.full_name(self.keys.through), NAVIGATE_THROUGH_POSES, {"poses": poses})

    def cancel(self, number: int) -> None:
        """Cancel the action with the request ``number``."""
        self._requests.cancel(number)

    def has_goal(self) -> bool:
        """Return True if an action that was started by this object may still be active."""
        return self._requests.has_goal()

    def stop(self) -> None:
        """Cancel all actions that were started by this object."""
        self._requests.cancel_all()

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run_once(self) -> float:
        if self._session is not None and self._disconnected.is_set():
            self._close_session()
            self._report_status("offline", "the router is gone", "is it still running, and is the network up?")
        if self._session is None:
            return self._connect()
        self._requests.check_servers(self._node)
        return POLL_INTERVAL

    def _connect(self) -> float:
        try:
            types()  # load them now: it is too slow for a tick
            session = open_session(self.name, self._access)
            self._disconnected.clear()
            transports = ConnectionMonitor(session, self._on_router_lost)
            keys = self.keys
            node = Ros2Node(
                session,
                self._clock,
                domain=self._domain,
                namespace=keys.namespace,
                name=self._node_name,
                report=self._report,
            )
        except NotConnected as error:
            self._error = error
            self._requests.check_servers(None)
            return RETRY_INTERVAL
        self._session, self._transports, self._session_count = session, transports, self._session_count + 1
        self._error, self._node = None, node
        self._report_status("online", f"{', '.join(self._access.endpoints)}: connected", "")
        return 0.0

    def _on_router_lost(self) -> None:
        self._disconnected.set()
        node = self._node
        if node is not None:
            node.is_lost = True
        self._loop.wake()

    def _close_session(self) -> None:
        session, node = self._session, self._node
        self._error = NotConnected("ros2: the router is gone", hint="is it still running, and is the network up?")
        self._session = self._node = self._transports = None
        if node is not None:
            node.is_lost = True
        if session is not None:
            try:
                session.close()
            except Exception as error:  # the session is abandoned in any case
                self._report_status("fault", f"the session did not close: {error}", "")

    def _finish(self) -> None:
        self._requests.cancel_all()
        node = self._node
        if node is not None:
            node.close()
        self._close_session()

    def _report_status(self, kind: str, what: str, hint: str) -> None:
        self._report(DeviceStatus(self.name, kind, what, hint))

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _subscribe(self, name: str, node: Ros2Node) -> None:
        """Subscribe to a topic, with the types of its publishers."""
        sent = {each.kind for each in node.entities(wire.PUBLISHER, name)}
        kinds = {kind for kind in sent if types().is_known(kind)}
        if not kinds:
            if sent:
                node.faults.add_for_topic(name, f"its type {' or '.join(sorted(sent))} is not known here")
            return
        self._subscriptions[name] = node

        def heard(kind: str, payload: bytes) -> None:
            self._latest_messages[name] = kind, payload, self._clock.now()
            self._changed()

        node.subscribe(name, kinds, heard)

    def _pose_stamped(self, place: MapPose, frame: str) -> dict[str, object]:
        x, y, heading = place
        if frame == START_FRAME:
            start, frame = self._origin
            turn = start.heading
            x, y = start.x + x * cos(turn) - y * sin(turn), start.y + x * sin(turn) + y * cos(turn)
            heading += turn
        turned = {"z": sin(heading / 2), "w": cos(heading / 2)}
        return {"header": {"frame_id": frame}, "pose": {"position": {"x": x, "y": y}, "orientation": turned}}
