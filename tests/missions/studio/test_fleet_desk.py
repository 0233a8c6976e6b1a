"""The studio at a fleet: who is there, all stopped and released; and none is joined where no file names one."""

import asyncio
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from threading import Event, Thread
from typing import Any, Self

import pytest

from config.defaults import config_folder
from config.fleet import FleetKeys
from missions.control.commands import BadMessage, ClientCommand
from missions.plugins.studio import studio as fleet
from missions.plugins.studio.studio import FleetConnection
from missions.plugins.studio.studio_commands import FleetQuery, ReleaseFleet, StopFleet
from tests.missions.service.fleets import CountingBody, free_port, local_fleet, member, router

PATIENCE = 60.0

FILE = "fleet: trial\nmode: client\nconnect: ['tcp/127.0.0.1:{port}']\nrobots: [anna, carl]\n"


def asked(desk: FleetConnection, command: ClientCommand) -> Mapping[str, Any]:
    return asyncio.run(desk.run_command(command, "viewer 1"))


def write(port: int) -> None:
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / "fleet.yaml").write_text(FILE.format(port=port), encoding="utf-8")


def test_a_studio_joins_no_fleet_unasked() -> None:
    with pytest.raises(BadMessage, match=r"there is no fleet\.yaml") as refused:
        asked(FleetConnection(), StopFleet())
    assert refused.value.error == "no_fleet"
    assert "fleet: home" in refused.value.hint


def test_invalid_fleet_file_is_reported() -> None:
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / "fleet.yaml").write_text("listen: ['tcp/0.0.0.0:7450']\n", encoding="utf-8")
    with pytest.raises(BadMessage, match="open to the network"):
        asked(FleetConnection(), FleetQuery())


@pytest.mark.real_time
def test_robots_are_listed_stopped_and_released(tmp_path: Path) -> None:
    port, body, desk = free_port(), CountingBody(), FleetConnection()
    write(port)
    with router(port), member(local_fleet(port), "anna", tmp_path, body):
        try:
            listed = asked(desk, FleetQuery())
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


def test_stop_does_not_wait_for_discovery(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, met, in_time = Event(), Event(), list[bool]()

    class Slow:
        fleet = FleetKeys(fleet="trial")

        def discover(self) -> None:
            looks.set()
            in_time.append(met.wait(PATIENCE))

        def members(self) -> Mapping[Any, Any]:
            return {}

        def missing_robots(self) -> list[str]:
            return []

        def stop(self, by: str) -> tuple[Mapping[Any, Any], list[str]]:
            return {}, [by]

    write(1)
    monkeypatch.setattr(fleet, "connect_operator", lambda _: nullcontext(Slow()))
    desk = FleetConnection()
    look = Thread(target=asked, args=(desk, FleetQuery()))
    look.start()
    try:
        assert looks.wait(PATIENCE)
        assert asked(desk, StopFleet())["silent"] == ["viewer 1"]
    finally:
        met.set()
        look.join()
    assert in_time == [True]


class Hurried:
    """At a fleet, and no longer once it is left."""

    fleet = FleetKeys(fleet="trial")

    def __init__(self, name: str) -> None:
        self.name, self.left = name, False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.left = True

    def stop(self, by: str) -> tuple[Mapping[Any, Any], list[str]]:
        return {}, [f"{self.name} for {by}"]


def test_fleet_stop_does_not_wait_for_an_opening_session(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opens, may_open, made = Event(), Event(), list[Hurried]()

    def opening(_: FleetKeys) -> Hurried:
        made.append(found := Hurried("slow" if not made else "quick"))
        if found.name == "slow":
            opens.set()
            assert may_open.wait(PATIENCE)
        return found

    write(1)
    monkeypatch.setattr(fleet, "connect_operator", opening)
    desk, slow = FleetConnection(), list[Mapping[str, Any]]()
    first = Thread(target=lambda: slow.append(asked(desk, StopFleet())))
    first.start()
    try:
        assert opens.wait(PATIENCE)
        assert asked(desk, StopFleet())["silent"] == ["quick for viewer 1"]
    finally:
        may_open.set()
        first.join()
    assert slow[0]["silent"] == ["quick for viewer 1"]
    assert [each.left for each in made] == [True, False]
    desk.close()
    assert made[1].left


def test_session_opened_while_the_studio_ends_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    desk, made = FleetConnection(), list[Hurried]()

    def opening(_: FleetKeys) -> Hurried:
        made.append(Hurried("late"))
        desk.close()
        return made[0]

    write(1)
    monkeypatch.setattr(fleet, "connect_operator", opening)
    with pytest.raises(BadMessage, match="has left the fleet"):
        asked(desk, StopFleet())
    assert made[0].left
