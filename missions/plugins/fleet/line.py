"""A fleet's wire: tokens, states and questions over one session of Zenoh. Whatever comes in may be anything."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from missions.codec import CodecError
from missions.plugins.fleet.roster import Roster
from missions.plugins.fleet.words import MAX_ANSWER, Address, Answer, Ask, address_in, as_bytes, key, read, read_ask

if TYPE_CHECKING:
    import zenoh

Reply = Callable[[Answer], None]
"""Sends the answer to what was asked, once, from any thread."""

OnAsk = Callable[[Ask, Reply], None]
"""Is asked something, on a thread of the wire."""

OnAnswer = Callable[[Address | None, Answer | None], None]
"""Gets each answer and whose it is, on a thread of the wire; in the end None."""


class ZenohLine:
    """One in a fleet, over a ``session``, which it closes. What it hears of the others it tells the ``roster``."""

    def __init__(self, session: "zenoh.Session", fleet: str, roster: Roster) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh, self._fleet, self._roster = zenoh, fleet, roster
        self._session: Any = session  # whose own types know no Callback
        self._kept: list[Any] = []  # what is declared ends with its object
        self._publisher: Any = None

    def follow(self) -> None:
        """Hear from now on who comes and goes, and what each tells."""

        def token(sample: Any) -> None:
            where, alive = str(sample.key_expr), sample.kind == self._zenoh.SampleKind.PUT
            self._roster.token(where, alive=alive)
            if alive:
                self._look("/".join(where.split("/")[-2:]))

        def told(sample: Any) -> None:
            self._roster.told(str(sample.key_expr), sample.payload.to_bytes())

        self._kept.append(self._session.declare_subscriber(key(self._fleet, "state"), told))
        liveliness = self._session.liveliness()
        self._kept.append(liveliness.declare_subscriber(key(self._fleet, "here"), token, history=True))

    def _look(self, where: str) -> None:
        """Ask a robot that has come how it is; returns at once."""

        def heard(reply: Any) -> None:
            if reply.ok is not None:
                self._roster.told(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

        self._session.get(key(self._fleet, "state", where), self._zenoh.handlers.Callback(heard), timeout=2.0)

    def announce(self, address: Address, on_stop: OnAsk, on_ask: OnAsk, state: Callable[[], bytes]) -> None:
        """Be seen by all as the robot of this address, which answers and tells its ``state`` from now on.

        A stop has a thread of its own: nothing else that is asked holds it up.
        """
        where = self._own = str(address)

        def told(query: Any) -> None:
            query.reply(key(self._fleet, "state", where), state())

        express = {"express": True, "priority": self._zenoh.Priority.DATA_HIGH}
        self._publisher = self._session.declare_publisher(
            key(self._fleet, "state", where), congestion_control=self._zenoh.CongestionControl.DROP, **express
        )
        for kind, answer in (("state", told), ("stop", self._answering(on_stop)), ("ask", self._answering(on_ask))):
            self._kept.append(self._session.declare_queryable(key(self._fleet, kind, where), answer))
        self._kept.append(self._session.liveliness().declare_token(key(self._fleet, "here", where)))

    def _answering(self, on_ask: OnAsk) -> Callable[[Any], None]:
        """Return what reads a question, and answers one that is none of ours with what is wrong with it."""

        def asked(query: Any) -> None:
            kind = str(query.key_expr).split("/")[3]

            def reply(answer: Answer) -> None:
                query.reply(key(self._fleet, kind, self._own), as_bytes(answer), express=True)
                query.drop()

            payload = query.payload
            try:
                ask = read_ask(b"" if payload is None else payload.to_bytes())
            except CodecError as error:
                reply(Answer(ok=False, why=str(error)))
                return
            on_ask(ask, reply)

        return asked

    def tell(self, state: bytes) -> None:
        """Tell all how it is."""
        self._publisher.put(state)

    def ask(self, ask: Ask, where: str, on_answer: OnAnswer, timeout: float) -> None:
        """Ask a robot, or ``*/*`` all; returns at once."""

        def heard(reply: Any) -> None:
            if reply.ok is None:
                return
            try:
                address = address_in(str(reply.ok.key_expr))
                answer = read(Answer, reply.ok.payload.to_bytes(), MAX_ANSWER)
            except CodecError:
                return
            on_answer(address, answer)

        kind = "stop" if ask.word == "stop" else "ask"
        self._session.get(
            key(self._fleet, kind, where),
            self._zenoh.handlers.Callback(heard, lambda: on_answer(None, None)),
            payload=as_bytes(ask),
            target=self._zenoh.QueryTarget.ALL,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            timeout=timeout,
            priority=self._zenoh.Priority.REAL_TIME,
            express=True,
        )

    def close(self) -> None:
        """Be gone."""
        self._session.close()
