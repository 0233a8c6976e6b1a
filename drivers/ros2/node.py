"""ROS 2 node on a Zenoh session: discovery, topics, services. No call waits for a reply.

It uses the Zenoh keys of `rmw_zenoh`, and in parallel those of bridges to DDS (``drivers.ros2.bridge``).
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from math import inf
from threading import Lock
from typing import TYPE_CHECKING, Any

from drivers.api import DeviceStatus, StatusCallback, ignore
from drivers.clock import Clock, unix_time_ns
from drivers.errors import NotConnected
from drivers.ros2 import bridge, wire
from drivers.ros2.publisher import FirstReply, MessageFilter, Publisher, ReplyHandler, new_gid
from drivers.ros2.types import types
from drivers.ros2.wire import Attachment, Entity
from drivers.transport.loop import guard_callback

if TYPE_CHECKING:
    import zenoh


# Unusable messages: counted and reported by topic, with expected type and received bytes.

REPORT_INTERVAL = 10.0
"""Minimum seconds between two reports of faults of the same topic."""

MALFORMED_LIFETIME = 2.0
"""Seconds after a malformed message for which its topic counts as faulty."""

MAX_TOPICS = 200
"""Maximum number of topics whose malformed messages are stored, since other nodes may use any number of names."""


class TopicFaults:
    """Faults of the ROS 2 topics of one ``part``; ``topics`` are their names. Thread-safe.

    A fault is a malformed message, for ``MALFORMED_LIFETIME`` seconds, or a node that uses another type under the name
    of the topic, as long as that node exists.
    """

    def __init__(self, part: str, topics: Sequence[str], clock: Clock, report: StatusCallback = ignore) -> None:
        self.count = 0
        self._part, self._topics, self._clock, self._report = part, list(topics), clock, guard_callback(report)
        self._lock = Lock()
        self._malformed: dict[str, tuple[str, float]] = {}
        self._mismatches: dict[str, str] = {}
        self._reported_at: dict[str, float] = {}

    def add(self, number: int, error: object) -> None:
        """Record a malformed message of the topic with the index ``number``; an unknown index is only counted."""
        self.count += 1
        if number < len(self._topics):
            self.add_for_topic(self._topics[number], error)

    def add_for_topic(self, topic: str, error: object) -> None:
        """Record a malformed message of a topic, a service or an action by its name."""
        with self._lock:
            if len(self._malformed) < MAX_TOPICS or topic in self._malformed:
                self._malformed[topic] = (f"{topic}: malformed message: {error}", self._clock.now())
        self._report_fault(topic)

    def mismatch(self, payload: bytes) -> None:
        """Record or end a type mismatch, by the payload of a ``wire.mismatch_frame``. Raises ValueError."""
        number, why = wire.parse_mismatch(payload)
        if number >= len(self._topics):
            return
        topic = self._topics[number]
        with self._lock:
            self._mismatches.pop(topic, None)
            if why:
                self._mismatches[topic] = f"{topic}: {why}"
                self._reported_at.pop(topic, None)
        self._report_fault(topic)

    def fault(self, number: int) -> str:
        """Return the current fault of the topic with the index ``number``; empty if it has none."""
        return self._current_fault(self._topics[number])

    def _current_fault(self, topic: str) -> str:
        with self._lock:
            said, at = self._malformed.get(topic, ("", -inf))
            return self._mismatches.get(topic, "") or (said if self._clock.now() - at <= MALFORMED_LIFETIME else "")

    def _report_fault(self, topic: str) -> None:
        why, now = self._current_fault(topic), self._clock.now()
        with self._lock:
            if not why or now - self._reported_at.get(topic, -inf) < REPORT_INTERVAL:
                return
            self._reported_at[topic] = now
        self._report(DeviceStatus(self._part, "fault", why, topic_hint(topic)))


def topic_hint(topic: str) -> str:
    """Return the command that shows the messages of a topic."""
    return f"`mission ros2 echo {topic}` shows its messages; is its node built for the ROS 2 of this robot?"


MessageHandler = Callable[[str, bytes], None]
"""Callback with the type and the bytes of a message. It runs on a thread of Zenoh, and must return at once."""

NO_ATTACHMENT = "without rmw_zenoh's attachment, ignored; is its node started with rmw_zenoh_cpp?"


class Ros2Node:
    """Our ROS 2 node ``name`` on a Zenoh ``session`` that the caller owns. Thread-safe.

    ``version`` is incremented whenever another node appears or disappears, or a topic or service of another node.
    """

    def __init__(
        self,
        session: "zenoh.Session",
        clock: Clock,
        *,
        domain: int = 0,
        namespace: str = "",
        name: str = "missiontree",
        report: StatusCallback = ignore,
    ) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh, self._session, self._clock = zenoh, session, clock
        self.domain, self.namespace, self.name = domain, namespace, name
        self.version = 0
        self.is_lost = False
        self.faults = TopicFaults("ros2", [], clock, report)
        """Faults of the messages of requests, actions and conditions, which belong to no part."""
        self._names_attachments = False  # as in received attachments: see Attachment
        self._zid = str(session.zid())
        self._lock = Lock()
        self._last_number = 0
        self._entities: dict[str, list[Entity]] = {}  # by token
        self._bridge_ids: frozenset[str] = frozenset()  # the sessions of bridges
        self._publishers: dict[tuple[str, str, str], Publisher] = {}
        self._declarations: list[tuple[object, Any]] = []
        self._declare_token(Entity(wire.NODE, domain, self._zid, "0", "0", name, namespace))
        # Last: the callback runs at once for all present tokens.
        for tokens in (f"{wire.LIVELINESS_PREFIX}/{domain}/**", bridge.TOKENS):
            self._add_declaration(session.liveliness().declare_subscriber(tokens, self._on_token, history=True))

    def now(self) -> float:
        """Return the time of the node's clock, in seconds."""
        return self._clock.now()

    def entities(self, role: str = "", name: str = "") -> list[Entity]:
        """Return the entities (topics, services) of other nodes with this role and name; empty means any.

        If a node announces an entity to `rmw_zenoh` and to bridges, as our node does, it is returned once.
        """
        with self._lock:
            found = [each for several in self._entities.values() for each in several]
            bridges = self._bridge_ids
        wanted = [each for each in found if role in {"", each.role} and name in {"", each.name}]
        return [each for each in wanted if not each.is_bridged or each.zid in bridges]

    @property
    def has_bridge(self) -> bool:
        """True if there is a bridge to robots with DDS."""
        return bool(self._bridge_ids)

    def publisher(self, name: str, kind: str, digest: str = "", *, blocks: bool = False) -> Publisher:
        """Return the publisher of the topic ``name`` with the type ``kind``.

        ``digest`` is the hash of the type if a subscriber's token has it. With ``blocks``, sending waits on a congested
        line instead of dropping the message; use it only on threads without deadlines. Raises NotConnected if the
        session is gone.
        """
        with self._lock:
            if (known := self._publishers.get((name, kind, digest))) is not None:
                return known
            entity = self._make_entity(wire.PUBLISHER, name, kind, digest)
            declared = self._declare_publisher(entity, blocks=blocks)
            attach = None if entity.is_bridged else self.make_attachment
            self._publishers[name, kind, digest] = made = Publisher(declared, entity, attach)
            if not digest:  # for subscribers behind a bridge, too
                behind = self._declare_publisher(replace(entity, digest=wire.BRIDGE), blocks=blocks)
                made.mirror_to(behind, lambda: self.has_bridge)
        if not entity.is_bridged:
            self._declare_token(entity)
        return made

    def _declare_publisher(self, entity: Entity, *, blocks: bool) -> Any:
        full = self._zenoh.CongestionControl.BLOCK if blocks else self._zenoh.CongestionControl.DROP
        try:
            return self._session.declare_publisher(entity.key, congestion_control=full, express=True)
        except self._zenoh.ZError as error:
            raise NotConnected(f"ros2: {entity.name}: the session of Zenoh has gone: {error}") from error

    def subscribe(
        self, name: str, kinds: Iterable[str], handler: MessageHandler, owner: object = None
    ) -> list[MessageFilter]:
        """Subscribe to the topic ``name`` with any of the types ``kinds``; return the message filters.

        The filters count messages. Earlier messages of a latched topic are received too. The subscription ends with the
        node, or by ``undeclare(owner)``.
        """
        sieves, latched, known = [], self.is_latched(name), tuple(kinds)
        for kind in known:
            with self._lock:
                entity = self._make_entity(
                    wire.SUBSCRIBER, name, kind, "", wire.LATCHED_QOS if latched else wire.DEFAULT_QOS
                )
            self._declare_token(entity, owner)
            sieve = MessageFilter()
            sieves.append(sieve)
            key, take = (
                wire.topic_key(self.domain, name, wire.to_dds_type(kind)),
                self._zenoh_handler(name, kind, sieve, handler),
            )
            self._add_declaration(self._declare_subscriber(key, take, with_history=latched), owner)
        sieves.append(MessageFilter())
        behind = self._bridge_handler(name, known, sieves[-1], handler)
        self._add_declaration(self._declare_subscriber(name.strip("/"), behind, with_history=latched), owner)
        return sieves

    def is_latched(self, name: str) -> bool:
        """True if a publisher of the topic keeps its last messages for late subscribers."""
        return any(each.is_latched for each in self.entities(wire.PUBLISHER, name))

    def _declare_subscriber(self, key: str, take: Callable[["zenoh.Sample"], None], *, with_history: bool) -> Any:
        """Declare a Zenoh subscriber.

        ``with_history`` also requests earlier messages from current and later publishers.
        """
        if not with_history:
            return self._session.declare_subscriber(key, take)
        from zenoh import ext  # noqa: PLC0415 - an extra

        history = ext.HistoryConfig(detect_late_publishers=True)
        return ext.declare_advanced_subscriber(self._session, key, take, history=history, subscriber_detection=True)

    def call(self, server: Entity, payload: bytes, on_reply: ReplyHandler, *, timeout: float) -> None:
        """Send a request to a discovered ``server``; ``on_reply`` is called once, after ``timeout`` seconds at most.

        Its argument is the reply, None if there is no reply. Raises NotConnected if the session is gone.
        """
        with self._lock:
            self._last_number += 1
            attached = None if server.is_bridged else self.make_attachment(self._last_number, new_gid())
        # Queryables of a bridge are not complete.
        target = self._zenoh.QueryTarget.BEST_MATCHING if server.is_bridged else self._zenoh.QueryTarget.ALL_COMPLETE
        once = FirstReply(on_reply)
        handler = self._zenoh.handlers.Callback(once.reply, once.finish)
        try:
            self._session.get(
                server.key,
                handler,
                target=target,
                consolidation=self._zenoh.ConsolidationMode.NONE,
                timeout=timeout,
                payload=payload,
                attachment=attached,
            )
        except self._zenoh.ZError as error:
            raise NotConnected(f"ros2: {server.name}: the session of Zenoh has gone: {error}") from error

    def serve(self, name: str, kind: str, handler: Callable[[bytes, Callable[[bytes], None]], None]) -> None:
        """Offer the service ``name`` of type ``kind``.

        ``handler`` is called with each request and a function that sends the reply, on a thread of Zenoh.
        """
        with self._lock:
            entity = self._make_entity(wire.SERVER, name, kind, "")

        def take(query: "zenoh.Query") -> None:
            told = self._parse_attachment(query.attachment)
            if query.payload is None or (told is None and str(query.key_expr) != behind):
                query.drop()  # type: ignore[no-untyped-call]
                return

            def answer(payload: bytes) -> None:
                with query:
                    attached = None if told is None else self.make_attachment(told.number, told.gid)
                    query.reply(query.key_expr, payload, attachment=attached)

            handler(bytes(query.payload), answer)

        key = wire.topic_key(self.domain, name, wire.to_dds_type(kind))  # any hash: CDR finds other definitions
        behind = name.strip("/")
        for each in (key, behind):
            self._add_declaration(self._session.declare_queryable(each, take, complete=True))
        self._declare_token(entity)
        if (announced := bridge.service_token(self._zid, name, kind)) is not None:
            self._add_declaration(self._session.liveliness().declare_token(announced))

    def undeclare(self, owner: object) -> None:
        """Undeclare the subscriptions of ``owner``."""
        with self._lock:
            gone = [each for whose, each in self._declarations if whose is owner]
            self._declarations = [(whose, each) for whose, each in self._declarations if whose is not owner]
        self._undeclare_all(gone)

    def close(self) -> None:
        """Undeclare all entities of this node, so that other nodes see that it is gone."""
        with self._lock:
            gone, self._declarations = [each for _, each in self._declarations], []
        self._undeclare_all(gone)

    def _undeclare_all(self, declared: list[Any]) -> None:
        for each in reversed(declared):
            with suppress(self._zenoh.ZError):  # the session is gone, and its declarations too
                each.undeclare()

    def make_attachment(self, number: int, gid: bytes) -> bytes:
        """Return the attachment of a message that is sent now.

        It has the sequence ``number`` of the message and the id ``gid`` of the sender.
        """
        return Attachment(number, unix_time_ns(), gid, self._names_attachments).pack()

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _parse_attachment(self, data: Any) -> Attachment | None:
        told = wire.parse_attachment(bytes(data or b""))
        if told is not None:
            self._names_attachments = told.has_names  # use the format of the other nodes
        return told

    def _make_entity(self, role: str, name: str, kind: str, digest: str, qos: str = wire.DEFAULT_QOS) -> Entity:
        self._last_number += 1
        found = digest or types().digest(kind)
        own = (self.domain, self._zid, "0", str(self._last_number), self.name, self.namespace)
        return Entity(role, *own, name, kind, found, qos)

    def _declare_token(self, entity: Entity, owner: object = None) -> None:
        try:
            token = self._session.liveliness().declare_token(entity.token)
        except self._zenoh.ZError as error:
            raise NotConnected(f"ros2: {self.name}: the session of Zenoh has gone: {error}") from error
        self._add_declaration(token, owner)

    def _add_declaration(self, declared: Any, owner: object = None) -> None:
        with self._lock:
            self._declarations.append((owner, declared))

    def _on_token(self, sample: "zenoh.Sample") -> None:
        token = str(sample.key_expr)
        own = wire.parse_entity(token)
        found = bridge.parse_token(token) if own is None else [own]
        if not found or found[0].zid == self._zid:
            return
        with self._lock:
            if sample.kind == self._zenoh.SampleKind.PUT:
                self._entities[token] = found
            else:
                self._entities.pop(token, None)
            first = [each[0] for each in self._entities.values()]
            nodes = {each.zid for each in first if not each.is_bridged}
            self._bridge_ids = frozenset(each.zid for each in first if each.is_bridged) - nodes
            self.version += 1

    def _bridge_handler(
        self, name: str, kinds: tuple[str, ...], sieve: MessageFilter, heard: MessageHandler
    ) -> Callable[["zenoh.Sample"], None]:
        """Return the handler for messages from a bridge.

        Such a message does not contain its type, so the type is read from the token of its publisher.
        """

        def take(sample: "zenoh.Sample") -> None:
            senders = self.entities(wire.PUBLISHER, name)
            known = [each.kind for each in senders if each.is_bridged and each.kind in kinds]
            if not senders and len(kinds) == 1:  # a message may precede the token
                known = [kinds[0]]
            payload, now = bytes(sample.payload), self._clock.now()
            if known and sieve.accepts(
                Attachment(sieve.count + 1, self._send_time(sample, known[0], payload), b""), now
            ):
                heard(known[0], payload)

        return take

    def _send_time(self, sample: "zenoh.Sample", kind: str, payload: bytes) -> int:
        """Return the time in ns at which a message from a bridge was sent; 0 if unknown.

        It is the time stamp of the router, or that in the message's header.
        """
        if sample.timestamp is not None:
            return round(sample.timestamp.get_time().timestamp() * 1e9)
        return types().stamp(kind, payload)

    def _zenoh_handler(
        self, name: str, kind: str, sieve: MessageFilter, heard: MessageHandler
    ) -> Callable[["zenoh.Sample"], None]:
        def take(sample: "zenoh.Sample") -> None:
            told = self._parse_attachment(sample.attachment)
            if told is None:
                self.faults.add_for_topic(name, NO_ATTACHMENT)
            elif sieve.accepts(told, self._clock.now()):
                heard(kind, bytes(sample.payload))

        return take
