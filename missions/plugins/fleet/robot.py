"""What a member of a fleet is besides being seen: it does tasks of the fleet, and keeps some of them."""

from collections.abc import Callable, Sequence
from contextlib import suppress

from missions.plugins.fleet.errands import ErrandQueue, Errands, Ready
from missions.plugins.fleet.keeper import Keeper
from missions.plugins.fleet.kept import Kept
from missions.plugins.fleet.member import Member
from missions.plugins.fleet.words import Address, Answer, Ask, Times
from missions.plugins.tasks.times import wall_clock


def employ(
    member: Member,
    queue: ErrandQueue,
    kept: Kept,
    *,
    robot: str = "",
    options: Sequence[str] = (),
    times: Times | None = None,
    knows: Callable[[str], bool] = lambda _: True,
) -> None:
    """Let a member do and keep tasks, before it is entered: as `mission run` on a ``robot`` with these ``options``.

    ``knows`` says whether there is a mission of a name; ``queue`` and ``kept`` are for the member's thread.
    """
    times, own = times or Times(), member.own.address
    ready, now = _asking(member, times), member.clock.now
    errands = Errands(
        own, queue, member.body, ready, now, wall_clock, held=lambda: member.latch.stopped or member.copied,
        robot=robot, options=tuple(options), times=times, knows=knows,
    )  # fmt: skip
    keeper = Keeper(own, kept, member.roster, ready, now, wall_clock, times)
    keeper.copied = lambda: member.copied
    member.workers += [errands, keeper]
    member.busy = errands.doing


def _asking(member: Member, times: Times) -> Ready:
    """Return what asks one robot, and wakes the member with its answer."""

    def ready(ask: Ask, address: Address, on_answer: Callable[[Answer | None], None]) -> None:
        answers: list[Answer] = []

        def heard(who: Address | None, answer: Answer | None) -> None:
            if who is not None and answer is not None:
                answers.append(answer)
                return
            on_answer(answers[0] if answers else None)
            member.wake()

        with suppress(Exception):  # the wire is closed, or not there yet: what is not answered is asked again
            member.line.ask(ask, str(address), heard, times.again * 2)

    return ready
