"""The missions that ship, each run: the motions on a base of arithmetic, the rest on the whole simulated robot.

Those that bump into something do so on virtual devices, in real time.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from drivers.api import Pose2D, Sides
from drivers.kobuki.virtual import VirtualKobuki
from missions.executive.build import build
from missions.executive.events import CommandSent, Event, Logged, NodeChanged
from missions.executive.executive import Result
from missions.library.shipped import MOTIONS, load_mission, shipped_missions
from missions.plugins.testing.recorders import STOP, LeafTestBench, good
from missions.request import RunRequest, Simulate
from missions.runner import Runner
from tests.behaviours.test_base import REPORT, LaggingBase
from tests.missions.command import command

BUMPED = Sides(centre=True)

# --- the motions -----------------------------------------------------------------------------------------------------


class Drive:
    """A motion on a base with a Kobuki's lags, in simulated time."""

    def __init__(self, name: str, **params: str) -> None:
        self.bench = LeafTestBench()
        self.base = LaggingBase(self.bench.clock, dead_time=0.2)
        self.places: list[Pose2D] = []
        robot = Robot(base_part=self.base)
        self.root = build(load_mission(name, params=params), self.bench.run, lambda _: robot)

    def run(self, seconds: float = 120.0) -> Status:
        """Let time pass until the motion has ended, or for ``seconds``."""
        for report in range(round(seconds / REPORT)):
            self.bench.clock.advance(REPORT)
            self.base.report()
            self.places.append(self.base.wheels.pose)
            if report % 5 in {0, 3} and self.bench.tick(self.root, after=0.0) is not RUNNING:
                break
        return self.root.status

    def end(self) -> tuple[float, float, float]:
        """Return where it ended: x and y in metres, and the heading in degrees."""
        pose = self.places[-1]
        return pose.x, pose.y, math.degrees(pose.heading)


@pytest.mark.parametrize(
    ("name", "params", "expected"),
    [
        ("forward", {"distance": "0.4 m"}, (0.4, 0.0, 0.0)),
        ("forward", {"distance": "-0.4 m", "speed": "0.1 m/s"}, (-0.4, 0.0, 0.0)),
        ("spin_left", {}, (0.0, 0.0, 360.0)),
        ("spin_left", {"angle": "90 deg", "speed": "30 deg/s"}, (0.0, 0.0, 90.0)),
        ("spin_right", {"angle": "180 deg"}, (0.0, 0.0, -180.0)),
        ("square", {"side": "0.3 m"}, (0.0, 0.0, 360.0)),
        ("triangle", {"side": "0.3 m"}, (0.0, 0.0, 360.0)),
        ("polygon", {"sides": "7", "side": "0.2 m"}, (0.0, 0.0, 360.0)),
        ("back_and_forth", {"distance": "0.3 m"}, (0.0, 0.0, 360.0)),
        ("back_and_forth", {"distance": "0.3 m", "rounds": "2"}, (0.0, 0.0, 720.0)),
        ("circle_anticlockwise", {}, (0.0, 0.0, 360.0)),
        ("circle_clockwise", {"radius": "0.5 m", "speed": "0.3 m/s"}, (0.0, 0.0, -360.0)),
    ],
)
def test_motion_missions_end_at_the_expected_pose(
    name: str, params: Mapping[str, str], expected: tuple[float, float, float]
) -> None:
    drive = Drive(f"motions/{name}", **params)
    assert drive.run() is SUCCESS
    x, y, heading = drive.end()
    assert (x, y) == pytest.approx(expected[:2], abs=0.04)
    assert heading == pytest.approx(expected[2], abs=8.0 if len(drive.places) > 1500 else 4.0)


@pytest.mark.parametrize(
    ("name", "width", "height"),
    [("square", 0.4, 0.4), ("triangle", 0.4, 0.4 * math.sin(math.pi / 3)), ("circle_anticlockwise", 0.8, 0.8)],
)
def test_figure_has_the_requested_size_and_lies_to_the_left(name: str, width: float, height: float) -> None:
    drive = Drive(f"motions/{name}", **({"radius": "0.4 m"} if name.startswith("circle") else {"side": "0.4 m"}))
    assert drive.run() is SUCCESS
    xs, ys = [place.x for place in drive.places], [place.y for place in drive.places]
    assert max(xs) - min(xs) == pytest.approx(width, abs=0.04)
    assert max(ys) == pytest.approx(height, abs=0.04)
    assert min(ys) > -0.04


@pytest.mark.parametrize("name", [*MOTIONS.values(), "polygon"])
def test_motion_mission_fails_and_stops_when_a_wheel_drops(name: str) -> None:
    drive = Drive(f"motions/{name}")
    assert drive.run(1.0) is RUNNING
    state = drive.base.reading.value
    assert state is not None
    drive.base.reading = good(type(state)(state.pose, state.velocity, wheel_drop=Sides(left=True)))
    assert drive.bench.tick(drive.root) is FAILURE
    assert drive.root.reason.endswith("a wheel has dropped")
    assert drive.base.commands[-1] == STOP


def test_the_motions_go_by_the_numbers_of_the_course() -> None:
    assert list(MOTIONS) == [str(number) for number in range(1, 9)]
    assert {f"motions/{name}" for name in MOTIONS.values()} | {"motions/polygon"} == {
        name for name in shipped_missions() if name.startswith("motions/")
    }


def test_motions_are_listed_and_run_by_their_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    listed = command(capsys, "list", "motions").out
    assert [line.split()[:2] for line in listed.splitlines()[1:]] == [list(item) for item in MOTIONS.items()]
    ran = command(capsys, "run", "1", "--param", "distance=5 cm", "--json")
    assert ran.code == 0
    assert '"mission": "forward"' in ran.out
    named = command(capsys, "run", "circle_clockwise", "--param", "radius=1 mm")
    assert named.code == 2
    assert "'radius' must be at least 0.05 m" in named.err
    wrong = command(capsys, "run", "9")
    assert wrong.code == 2
    assert "unknown mission '9'; motions of the course go from 1 to 8: mission list motions" in wrong.err


# --- the rest, on the whole simulated robot --------------------------------------------------------------------------


class Ran:
    """A mission that was run: how it ended, its events, and what was said."""

    def __init__(
        self,
        mission: str,
        params: Mapping[str, str] | None = None,
        *,
        world: str | None = None,
        simulate: Simulate = "fast",
        when: Callable[[Event], bool] = lambda _: False,
        then: Callable[[Runner], None] = lambda _: None,
    ) -> None:
        self.events: list[Event] = []
        self._when, self._then = when, then
        self.runner = Runner(RunRequest(mission, params or {}, simulate=simulate, world=world), listeners=[self._hear])
        self.result: Result = self.runner.run()
        self.said = [event.text for event in self.events if isinstance(event, Logged) and event.level == "voice"]

    def _hear(self, event: Event) -> None:
        self.events.append(event)
        if self._when(event):
            self._then(self.runner)

    def commands(self, part: str) -> list[Mapping[str, object]]:
        """Return what a part was told, in order."""
        return [event.values for event in self.events if isinstance(event, CommandSent) and event.to == part]

    def ends(self, kind: str) -> list[str]:
        """Return how the leaves of a kind ended, in order."""
        found = [event for event in self.events if isinstance(event, NodeChanged) and event.kind == kind]
        return [event.status for event in found if event.status in {"success", "failure"}]


def bump(runner: Runner) -> None:
    """Run the simulated base into something."""
    simulation = runner._robot.simulation
    assert simulation is not None
    kobuki = simulation.device(VirtualKobuki)
    assert kobuki is not None
    kobuki.bumper = BUMPED


def begins(kind: str) -> Callable[[Event], bool]:
    """Return whether an event is that a leaf of this kind has begun."""
    return lambda event: isinstance(event, NodeChanged) and event.kind == kind and event.status == "running"


def test_find_person_returns_the_face(tmp_path: Path) -> None:
    mission = tmp_path / "seek.yaml"
    mission.write_text(
        "mission: seek\ntree:\n  sequence:\n    - mission: find_person\n    - say: ${round(person.distance)}\n"
    )
    ran = Ran(str(mission), world="two_people")
    assert ran.result.result == "success"
    assert ran.said in (["1 m"], ["2 m"]), "the person stands about a metre and a half away"


def test_find_person_turns_the_base_and_fails_in_an_empty_world() -> None:
    ran = Ran("find_person", {"patience": "4 s", "side": "5 deg"}, world="empty")
    assert (ran.result.result, ran.result.reason) == ("failure", "nobody found in 4 s")
    assert any(command["angular"] != 0.0 for command in ran.commands("base"))


def test_greet_everybody_greets_each_of_two_people_once() -> None:
    ran = Ran("greet_everybody", {"greeting": "Ahoy", "side": "15 deg"}, world="two_people")
    assert (ran.result.result, ran.result.reason) == ("success", "")
    assert sorted(ran.said) == ["Ahoy, Anna!", "Ahoy, Ben!"], "who is found first may be either"
    assert ran.ends("find_face") == ["success", "success", "failure"]


def test_greet_everybody_fails_in_an_empty_world() -> None:
    ran = Ran("greet_everybody", {"side": "5 deg"}, world="empty")
    assert (ran.result.result, ran.result.reason) == ("failure", "nobody is here")
    assert ran.said == []


def test_look_around_looks_to_both_sides_and_ahead_again() -> None:
    ran = Ran("look_around", {"side": "40 deg", "pause": "10 ms"})
    assert ran.result.result == "success"
    pans = [command["pan"] for command in ran.commands("head") if "pan" in command]
    assert pans == pytest.approx([math.radians(40), math.radians(-40), 0.0], abs=1e-3)


def test_look_away_turns_the_camera_from_the_blank_ceiling(tmp_path: Path) -> None:
    mission = tmp_path / "up.yaml"
    mission.write_text("mission: up\ntree:\n  sequence:\n    - look: {tilt: -60 deg}\n    - mission: look_away\n")
    ran = Ran(str(mission))
    assert ran.result.result == "success"
    assert ran.ends("scene_uniform") == ["success", "failure"]
    assert [command["tilt"] for command in ran.commands("head") if "tilt" in command] == pytest.approx(
        [math.radians(-60), 0.0], abs=1e-3
    )


def test_look_away_does_not_pan_with_something_in_view() -> None:
    ran = Ran("look_away")
    assert ran.result.result == "success"
    assert not [command for command in ran.commands("head") if "pan" in command]


def test_look_away_fails_in_the_dark(tmp_path: Path) -> None:
    world = tmp_path / "dark.yaml"
    world.write_text("world: dark\nlight: 0 %\n")
    ran = Ran("look_away", {"side": "15 deg"}, world=str(world))
    assert ran.result.result == "failure"
    assert ran.result.reason.startswith("the picture is uniform wherever I look")


def test_follow_me_drives_after_a_distant_person() -> None:
    ran = Ran("follow_me", {"duration": "2 s", "distance": "0.6 m"}, world="two_people")
    assert ran.result.result == "success"
    assert ran.said == ["I will follow you."]
    speeds = [command["linear"] for command in ran.commands("base")]
    assert max(speed for speed in speeds if isinstance(speed, float)) > 0.05
    assert speeds[-1] == 0.0


@pytest.mark.real_time
def test_follow_me_stops_at_a_bump() -> None:
    far = {"duration": "10 s", "distance": "0.6 m"}
    ran = Ran("follow_me", far, world="two_people", simulate="wire", when=begins("follow_person"), then=bump)
    assert (ran.result.result, ran.result.reason) == ("failure", "bumped into something")
    assert ran.commands("base")[-1]["linear"] == 0.0


@pytest.mark.real_time
def test_patrol_ends_at_a_bump() -> None:
    ran = Ran("patrol", simulate="wire", when=begins("drive"), then=bump)
    assert (ran.result.result, ran.result.reason) == ("failure", "bumped into something")
