"""The fleet of this computer, for the page: who is there and what each does, and all of them stopped or released."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from threading import Lock
from typing import TypeVar

from config.defaults import config_folder
from config.faults import InvalidFileError
from config.fleet import FILE, load_fleet
from missions.service.fleet.operator import Operator, operating
from missions.service.fleet.roster import Member
from missions.service.fleet.words import Address, Answer
from missions.service.task import TaskError
from missions.studio.commands import Command
from missions.studio.form import BadMessage
from missions.studio.wishes import Fleet, ReleaseFleet, StopFleet

T = TypeVar("T")

Json = Mapping[str, object]


class FleetDesk:
    """Somebody at the fleet of ``fleet.yaml``, from the first time that anybody asks until it is closed.

    Without that file there is no fleet: a studio joins none unasked.
    """

    def __init__(self) -> None:
        self._closed, self._lock = ExitStack(), Lock()
        self._operator: Operator | None = None
        self._closings = 0
        self._met = False

    async def do(self, command: Command, by: str) -> Json:
        """Do what is asked of the fleet. Raises BadMessage("no_fleet")."""
        match command:
            case Fleet():
                return await self._there(self._list)
            case StopFleet():
                return await self._there(lambda operator: _stopped(*operator.stop(by)))
            case ReleaseFleet():
                names = [command.robot] if command.robot else []
                return await self._there(lambda operator: _answers(operator.release(names, by, resume=command.resume)))
        raise BadMessage("unknown_command", f"a fleet does not know '{command.word}'")

    async def _there(self, work: Callable[[Operator], T]) -> T:
        try:
            return await asyncio.to_thread(lambda: work(self._at()))
        except (TaskError, InvalidFileError) as error:
            raise BadMessage("no_fleet", str(error)[:2000], str(getattr(error, "hint", ""))[:500]) from error

    def _at(self) -> Operator:
        """Return who is at the fleet. Opening a session may take its time: nobody waits for another's."""
        with self._lock:
            if self._operator is not None:
                return self._operator
            closings = self._closings
        if not (config_folder() / FILE).is_file():
            hint = f"echo 'fleet: home' > {config_folder() / FILE}"
            raise TaskError(f"there is no {FILE}, which says in which fleet this computer is", hint=hint)
        with ExitStack() as opened:
            operator = opened.enter_context(operating(load_fleet()))
            with self._lock:
                if self._closings != closings:
                    raise TaskError("the studio has left the fleet")
                if self._operator is None:  # else another was quicker, and this session is closed again
                    self._operator, self._closed = operator, opened.pop_all()
                return self._operator

    def _list(self, operator: Operator) -> Json:
        """Say who is there; waits for that, the first time, while others may stop the fleet."""
        met, self._met = self._met, True
        if not met:
            operator.meet()
        return _listed(operator)

    def close(self) -> None:
        """Leave the fleet."""
        with self._lock:
            self._operator, self._met = None, False
            self._closings += 1
            closed, self._closed = self._closed, ExitStack()
        closed.close()


def _listed(operator: Operator) -> Json:
    members = sorted(operator.members().values(), key=lambda each: each.address)
    return {"fleet": operator.fleet.fleet, "robots": [_robot(each) for each in members], "missing": operator.missing()}


def _robot(member: Member) -> Json:
    told = {} if member.state is None else asdict(member.state)
    return {"name": member.address.name, "number": member.address.number, "connection": member.connection, **told} | (
        {"number": member.address.number}
    )


def _stopped(answers: Mapping[Address, Answer], silent: list[str]) -> Json:
    return {**_answers(answers), "silent": silent}


def _answers(answers: Mapping[Address, Answer]) -> Json:
    return {"answers": {str(address): {"ok": answer.ok, "why": answer.why} for address, answer in answers.items()}}
