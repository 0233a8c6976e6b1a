"""Active requests to ROS 2 services and actions: state machine, feedback and results."""

import json
from collections.abc import Callable, Mapping
from enum import Enum
from functools import partial
from itertools import count
from math import inf
from threading import RLock
from typing import Final
from uuid import uuid4

from drivers.api.ros2 import GoalState, Progress
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.ros2 import wire
from drivers.ros2.action_server import UNKNOWN_GOAL, decode_result, failure_reason
from drivers.ros2.node import Ros2Node
from drivers.ros2.publisher import ReplyHandler
from drivers.ros2.types import MalformedMessage, types
from drivers.ros2.wire import CANCEL, CANCEL_KIND, FEEDBACK, RESULT, SEND
from drivers.transport.loop import guard_callback

REPLY_TIMEOUT = 2.0
"""Seconds in which a server must accept or reject a goal, or confirm a cancel."""

RESULT_TIMEOUT = 30 * 86400.0
"""Seconds to wait for the result of an action or a service. A server that disappears is detected earlier."""

CANCEL_RETRY_INTERVAL = 1.0
"""Seconds after which a cancel is sent again if its goal may still be active."""

SERVER_TIMEOUT = 1.0
"""Seconds for which the state of a request still counts as known after its server has disappeared."""

MAX_KEPT_REQUESTS = 100
"""Maximum number of ended requests whose progress is kept."""

GOAL_STATES = {4: GoalState.SUCCEEDED, 5: GoalState.CANCELLED, 6: GoalState.FAILED}
"""Final states of an action, by their numbers in action_msgs."""

CANCEL_REJECTED = 1
"""Return code of a server that rejects a cancel, as action_msgs numbers it."""

_GOAL_STATUS_NAMES = {4: "succeeded", 5: "was cancelled", 6: "was aborted"}


class GoalPhase(Enum):
    """Phase of a request. In ORPHANED it is not known whether the goal has ended.

    CANCEL_ON_ACCEPT: the request is cancelled once its server accepts it. CANCEL_DUE: a cancel must be sent. An
    orphaned goal may be active until its server has confirmed a cancel.
    """

    SENT, CANCEL_ON_ACCEPT, RUNNING, CANCEL_DUE, CANCEL_SENT, ORPHANED, OVER = range(7)


class GoalEvent(Enum):
    """Event of a request.

    CANCEL: the caller cancels it. CANCEL_SENT: the cancel was sent to the server. LOSE: the server or its reply is
    lost. END: it has ended. The others are replies of the server.
    """

    ACCEPT, CANCEL, CANCEL_SENT, REFUSE_CANCEL, CONFIRM_CANCEL, LOSE, END = range(7)


ACTIVE_PHASES: Final = frozenset(GoalPhase) - {GoalPhase.ORPHANED, GoalPhase.OVER}

TRANSITIONS: Final = {
    **{(phase, GoalEvent.END): GoalPhase.OVER for phase in ACTIVE_PHASES},
    **{(phase, GoalEvent.LOSE): GoalPhase.ORPHANED for phase in ACTIVE_PHASES},
    (GoalPhase.SENT, GoalEvent.ACCEPT): GoalPhase.RUNNING,
    (GoalPhase.SENT, GoalEvent.CANCEL): GoalPhase.CANCEL_ON_ACCEPT,
    (GoalPhase.CANCEL_ON_ACCEPT, GoalEvent.ACCEPT): GoalPhase.CANCEL_DUE,
    (GoalPhase.RUNNING, GoalEvent.CANCEL): GoalPhase.CANCEL_DUE,
    (GoalPhase.CANCEL_DUE, GoalEvent.CANCEL_SENT): GoalPhase.CANCEL_SENT,
    (GoalPhase.CANCEL_SENT, GoalEvent.CANCEL): GoalPhase.CANCEL_DUE,
    (GoalPhase.CANCEL_SENT, GoalEvent.REFUSE_CANCEL): GoalPhase.CANCEL_DUE,
    (GoalPhase.ORPHANED, GoalEvent.CONFIRM_CANCEL): GoalPhase.OVER,
}
"""Next phase of a request by phase and event. Other pairs change nothing, since replies may be late or repeated."""


class _Request:
    """A request to a service, or a goal of an action. Its phase is changed under the lock of ``RequestTracker``."""

    def __init__(self, name: str, kind: str, server: wire.Entity, *, goal: bool) -> None:
        self.name, self.kind, self.server, self.is_goal = name, kind, server, goal
        self.uuid = list(uuid4().bytes)
        self.progress = Progress(GoalState.SENT)
        self.phase = GoalPhase.SENT
        self.cancel_sent_at = -inf  # time of the last cancel request
        self.lost_since: float | None = None

    def handle(self, event: GoalEvent) -> None:
        """Change the phase for an event."""
        self.phase = TRANSITIONS.get((self.phase, event), self.phase)


class RequestTracker:
    """Active and ended requests of one robot to ROS 2 services and actions. Thread-safe.

    ``get_node`` returns our node. ``changed`` is called after each progress of a request, on threads of Zenoh.
    """

    def __init__(self, get_node: Callable[[], Ros2Node], clock: Clock, changed: Callable[[], None]) -> None:
        self._get_node, self._clock = get_node, clock
        self._changed = guard_callback(changed)
        self._lock = RLock()
        self._numbers = count(1)
        self._requests: dict[int, _Request] = {}
        self._feedback_nodes: dict[tuple[str, str], Ros2Node] = {}  # subscriptions to feedback, by action

    def call(self, name: str, kind: str, values: str) -> int:
        """Call a service; return the number of the request. Raises BadRequest, NotConnected."""
        server = self._find_server(name, kind)
        payload = types().encode(f"{server.kind}_Request", _parse_object(server.kind, values))
        number, request = self._register(_Request(name, server.kind, server, goal=False))
        self._get_node().call(server, payload, partial(self._on_response, request), timeout=RESULT_TIMEOUT)
        return number

    def begin(self, name: str, kind: str, goal: Mapping[str, object]) -> int:
        """Send a goal to an action; return the number of the request. Raises BadRequest, NotConnected."""
        server = self._find_server(f"{name}/{SEND}", kind and f"{kind}_SendGoal")
        kind = server.kind.removesuffix("_SendGoal")
        request = _Request(name, kind, server, goal=True)
        payload = types().encode(server.kind + "_Request", {"goal_id": {"uuid": request.uuid}, "goal": goal})
        number, request = self._register(request)
        self._subscribe_feedback(name, kind)
        self._get_node().call(server, payload, partial(self._on_goal_response, request), timeout=REPLY_TIMEOUT)
        return number

    def cancel(self, number: int) -> None:
        """Cancel the action with the request ``number``, once it is accepted. Each call sends the cancel again."""
        with self._lock:
            request = self._requests.get(number)
            if request is None or not request.is_goal or request.phase is GoalPhase.OVER:
                return
            request.handle(GoalEvent.CANCEL)
            begun = request.phase is not GoalPhase.CANCEL_ON_ACCEPT
            self._set_progress(request, GoalState.CANCELLING)
        if begun:
            self._send_cancel(request)

    def cancel_all(self) -> None:
        """Cancel all actions."""
        for number in list(self._requests):
            self.cancel(number)

    def has_goal(self) -> bool:
        """Return True if the goal of an action may still be active."""
        with self._lock:
            return any(each.is_goal and each.phase is not GoalPhase.OVER for each in self._requests.values())

    def progress(self, number: int) -> Progress:
        """Return the progress of the request ``number``. Raises BadRequest if it is unknown or no longer kept."""
        request = self._requests.get(number)
        if request is None:
            raise BadRequest(f"ros2: unknown request {number}")
        return request.progress

    def check_servers(self, node: Ros2Node | None) -> None:
        """Detect servers that have disappeared, and cancel orphaned goals once their server is back.

        Call this regularly; ``node`` is our current node, or None.
        """
        now = self._clock.now()
        for request in list(self._requests.values()):
            self._cancel_again(request, node, now)
            if request.progress.is_final:
                continue
            # A restarted server does not know the requests to its predecessor.
            there = node is not None and request.server in node.entities(wire.SERVER, request.server.name)
            with self._lock:
                if there:
                    request.lost_since = None
                    continue
                if request.lost_since is None:
                    request.lost_since = now
                elif now - request.lost_since >= SERVER_TIMEOUT:
                    what = "its server is gone" if node is not None else "the network is gone"
                    self._set_progress(request, GoalState.UNKNOWN, f"{request.name}: {what}; it may still be active")

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _find_servers(self, name: str, kind: str) -> list[wire.Entity]:
        found = [each for each in self._get_node().entities(wire.SERVER, name) if kind in {"", each.kind}]
        if not found:
            told = name.removesuffix(f"/{SEND}")
            of = f" of the type {kind.removesuffix('_SendGoal')}" if kind else ""
            raise NotConnected(
                f"ros2: no server of {told}{of}", hint="`mission ros2 topics --all` lists what is available"
            )
        return found

    def _find_server(self, name: str, kind: str) -> wire.Entity:
        """Return the only server of the name.

        Raises NotConnected if there are several, such as those of two robots, since all would execute a request.
        """
        found = self._find_servers(name, kind)
        if len(found) > 1:
            what = f"ros2: {len(found)} servers of {name.removesuffix(f'/{SEND}')}: all of them would execute it"
            raise NotConnected(what, hint="`mission ros2 graph` shows them; two robots need a namespace each")
        return found[0]

    def _register(self, request: _Request) -> tuple[int, _Request]:
        with self._lock:
            number = next(self._numbers)
            self._requests[number] = request
            over = [each for each, it in self._requests.items() if it.phase is GoalPhase.OVER]
            for each in over[:-MAX_KEPT_REQUESTS]:
                del self._requests[each]
        return number, request

    def _set_progress(
        self, request: _Request, state: GoalState, reason: str = "", *, feedback: str = "", result: str = ""
    ) -> None:
        with self._lock:
            if request.progress.is_final:
                return
            request.progress = Progress(state, reason, feedback or request.progress.feedback, result)
            if request.progress.is_final:
                loose = request.is_goal and state is GoalState.UNKNOWN
                request.handle(GoalEvent.LOSE if loose else GoalEvent.END)
        self._changed()

    def _on_response(self, request: _Request, payload: bytes | None) -> None:
        if payload is None:
            self._set_progress(request, GoalState.UNKNOWN, f"{request.name}: no reply")
            return
        try:
            told = types().decode(f"{request.kind}_Response", payload)
        except MalformedMessage as error:
            self._set_progress(request, GoalState.FAILED, f"{request.name}: {error}")
            return
        self._set_progress(request, GoalState.SUCCEEDED, result=json.dumps(types().to_plain(told)))

    def _on_goal_response(self, request: _Request, payload: bytes | None) -> None:
        """Handle the reply to a goal; request the result if the goal was accepted."""
        try:
            told = None if payload is None else types().decode(f"{request.kind}_SendGoal_Response", payload)
        except MalformedMessage as error:
            told = None
            self._set_progress(request, GoalState.UNKNOWN, f"{request.name}: {error}")
        if told is None:
            # It may have been accepted and the answer lost: cancel it in any case.
            self._send_cancel(request)
            self._set_progress(request, GoalState.UNKNOWN, f"{request.name}: no reply within {REPLY_TIMEOUT:g} s")
            return
        if not told.accepted:
            self._set_progress(request, GoalState.FAILED, f"{request.name}: the goal was rejected")
            return
        with self._lock:
            request.handle(GoalEvent.ACCEPT)
            cancel = request.phase in (GoalPhase.CANCEL_DUE, GoalPhase.CANCEL_SENT)
            self._set_progress(request, GoalState.CANCELLING if cancel else GoalState.RUNNING)
        if cancel:
            self._send_cancel(request)
        service = f"{request.kind}_GetResult"
        asked = types().encode(f"{service}_Request", {"goal_id": {"uuid": request.uuid}})
        self._call_part(request, RESULT, service, asked, partial(self._on_result, request), RESULT_TIMEOUT)

    def _on_result(self, request: _Request, payload: bytes | None) -> None:
        if payload is None:
            self._set_progress(request, GoalState.UNKNOWN, f"{request.name}: no result received")
            return
        status, values = decode_result(request.kind, payload)
        state = GOAL_STATES.get(status, GoalState.UNKNOWN)
        why = "" if state is GoalState.SUCCEEDED else failure_reason(request.kind, values)
        why = why or (
            "" if state is GoalState.SUCCEEDED else f"it {_GOAL_STATUS_NAMES.get(status, f'ended as {status}')}"
        )
        told = f"{request.name}: {why}" if why else ""
        self._set_progress(request, state, told, result=json.dumps(values))

    def _send_cancel(self, request: _Request) -> None:
        with self._lock:
            request.handle(GoalEvent.CANCEL_SENT)
            request.cancel_sent_at = self._clock.now()
        asked = types().encode(f"{CANCEL_KIND}_Request", {"goal_info": {"goal_id": {"uuid": request.uuid}}})
        self._call_part(request, CANCEL, CANCEL_KIND, asked, partial(self._on_cancel_response, request), REPLY_TIMEOUT)

    def _on_cancel_response(self, request: _Request, payload: bytes | None) -> None:
        """Handle the reply to a cancel. The end of the goal arrives as its result."""
        try:
            code = (
                CANCEL_REJECTED if payload is None else types().decode(f"{CANCEL_KIND}_Response", payload).return_code
            )
        except MalformedMessage as error:
            code = CANCEL_REJECTED  # unknown whether it was cancelled
            self._get_node().faults.add_for_topic(f"{request.name}/{CANCEL}", error)
        with self._lock:
            if code == CANCEL_REJECTED:
                request.handle(GoalEvent.REFUSE_CANCEL)
                return
            request.handle(GoalEvent.CONFIRM_CANCEL)
        if code == UNKNOWN_GOAL:
            self._set_progress(request, GoalState.FAILED, f"{request.name}: its server no longer knows this goal")

    def _cancel_again(self, request: _Request, node: Ros2Node | None, now: float) -> None:
        """Send the cancel of a request again, if the last one may be lost and the server exists.

        An orphaned goal is cancelled in this way as well.
        """
        with self._lock:
            due = request.phase in (GoalPhase.CANCEL_DUE, GoalPhase.ORPHANED)
            if not due or node is None or now - request.cancel_sent_at <= CANCEL_RETRY_INTERVAL:
                return
        if node.entities(wire.SERVER, f"{request.name}/{CANCEL}"):
            self._send_cancel(request)

    def _call_part(
        self, request: _Request, part: str, kind: str, payload: bytes, on_reply: ReplyHandler, timeout: float
    ) -> None:
        try:
            server = self._find_servers(f"{request.name}/{part}", kind)[0]
            self._get_node().call(server, payload, on_reply, timeout=timeout)
        except NotConnected as error:
            self._set_progress(request, GoalState.UNKNOWN, str(error))

    def _subscribe_feedback(self, name: str, kind: str) -> None:
        node = self._get_node()
        with self._lock:
            if self._feedback_nodes.get((name, kind)) is node:
                return
            self._feedback_nodes[name, kind] = node
        told = f"{kind}_FeedbackMessage"
        node.subscribe(f"{name}/{FEEDBACK}", [told], self._on_feedback)

    def _on_feedback(self, kind: str, payload: bytes) -> None:
        try:
            told = types().decode(kind, payload)
            uuid = told.goal_id.uuid.tolist()
        except (MalformedMessage, AttributeError) as error:
            self._get_node().faults.add_for_topic(kind, error)
            return
        for request in list(self._requests.values()):
            if request.uuid == uuid and not request.progress.is_final:
                feedback = json.dumps(types().to_plain(told.feedback))
                self._set_progress(request, request.progress.state, feedback=feedback)


def _parse_object(kind: str, values: str) -> Mapping[str, object]:
    try:
        found = json.loads(values or "{}")
    except ValueError as error:
        raise BadRequest(f"{kind}: {values!r} is not valid JSON: {error}") from error
    if not isinstance(found, dict):
        raise BadRequest(f"{kind}: needs an object with its fields, got {values!r}")
    return found
