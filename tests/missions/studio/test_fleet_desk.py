"""The studio at a fleet: who is there, all stopped and released; and none is joined where no file names one."""

import asyncio
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from config.defaults import config_folder
from config.fleet import FleetKeys
from missions.studio import fleet
from missions.studio.commands import Command
from missions.studio.fleet import FleetDesk
from missions.studio.form import BadMessage
from missions.studio.wishes import Fleet, ReleaseFleet, StopFleet
from tests.missions.service.fleets import CountingBody, free_port, local_fleet, member, router

pytestmark = pytest.mark.real_time

FILE = "fleet: trial\nmode: client\nconnect: ['tcp/127.0.0.1:{port}']\nrobots: [anna, carl]\n"


def asked(desk: FleetDesk, command: Command) -> Mapping[str, Any]:
    return asyncio.run(desk.do(command, "viewer 1"))


def write(port: int) -> None:
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / "fleet.yaml").write_text(FILE.format(port=port), encoding="utf-8")


def test_a_studio_joins_no_fleet_unasked() -> None:
    with pytest.raises(BadMessage, match=r"there is no fleet\.yaml") as refused:
        asked(FleetDesk(), StopFleet())
    assert refused.value.error == "no_fleet"
    assert "fleet: home" in refused.value.hint


def test_a_file_that_is_wrong_is_told() -> None:
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / "fleet.yaml").write_text("listen: ['tcp/0.0.0.0:7450']\n", encoding="utf-8")
    with pytest.raises(BadMessage, match="open to the network"):
        asked(FleetDesk(), Fleet())


def test_robots_are_listed_stopped_and_released(tmp_path: Path) -> None:
    port, body, desk = free_port(), CountingBody(), FleetDesk()
    write(port)
    with router(port), member(local_fleet(port), "anna", tmp_path, body):
        try:
            listed = asked(desk, Fleet())
            assert [(each["name"], each["connection"], each["robot"]) for each in listed["robots"]] == [
                ("anna", "ONLINE", "turtlebot2")
            ]
            assert listed["missing"] == ["carl"]
            stopped = asked(desk, StopFleet())
            assert stopped["answers"] == {"anna/0000000a": {"ok": True, "why": "stopped (base)"}}
            assert stopped["silent"] == ["carl"]
            assert body.said == ["stop by viewer 1"]
            released = asked(desk, ReleaseFleet(robot="anna"))
            assert released["answers"] == {"anna/0000000a": {"ok": True, "why": "released"}}
        finally:
            desk.close()


def test_a_stop_does_not_wait_for_who_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, met, in_time = Event(), Event(), list[bool]()

    class Slow:
        fleet = FleetKeys(fleet="trial")

        def meet(self) -> None:
            looks.set()
            in_time.append(met.wait(5.0))

        def members(self) -> Mapping[Any, Any]:
            return {}

        def missing(self) -> list[str]:
            return []

        def stop(self, by: str) -> tuple[Mapping[Any, Any], list[str]]:
            return {}, [by]

    write(1)
    monkeypatch.setattr(fleet, "operating", lambda _: nullcontext(Slow()))
    desk = FleetDesk()
    look = Thread(target=asked, args=(desk, Fleet()))
    look.start()
    try:
        assert looks.wait(10.0)
        assert asked(desk, StopFleet())["silent"] == ["viewer 1"]
    finally:
        met.set()
        look.join()
    assert in_time == [True]
