"""From world files to worlds and drawings: what ships, what the docs show, and ``mission show``."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pytest

from config import world_items as config_people
from config import world_items as config_things
from config.colours import COLOURS
from config.library import shipped_files
from config.world import WorldConfig, load_world
from config.world_items import ROBOT_RADIUS
from drivers.api import BASE_RADIUS, Pose2D
from drivers.sim import people, person_actions, topview, world_objects
from drivers.sim import world_objects as dock
from drivers.sim.appearances import APPEARANCES
from drivers.sim.base_body import BaseBody
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import WorldBall
from missions.library.worlds import build_battery, build_world
from missions.plugins.pictures.plan import UNITS_PER_METRE, plan_svg
from missions.plugins.pictures.world_text import describe_world
from tests.missions.command import command

DOCS = Path(__file__).parents[2] / "docs" / "worlds.md"
WORLDS = list(shipped_files("worlds"))


def config_of(name: str) -> WorldConfig:
    return load_world(shipped_files("worlds")[name])


def elements(svg: str) -> list[ET.Element]:
    return list(ET.fromstring(svg).iter())  # noqa: S314 - our own drawing


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in elements(svg) if element.tag.endswith("text")]


@pytest.mark.parametrize("name", WORLDS)
def test_every_shipped_world_builds_with_a_free_start_pose(name: str) -> None:
    world = build_world(config_of(name))
    start = world.start
    assert world.contact_directions(start.x, start.y, ROBOT_RADIUS, 0.0) == []
    assert world.has_floor(start.x, start.y)


def test_files_and_simulation_mean_the_same() -> None:
    assert set(config_people.LOOKS) == APPEARANCES.keys()
    assert config_people.REACTION_TIME == person_actions.REACTION_TIME
    assert config_people.PERSON_RADIUS == people.BODY_RADIUS
    assert config_things.WALL_THICKNESS == world_objects.WALL_THICKNESS
    assert config_things.MARKER_COUNT == world_objects.MARKER_COUNT
    assert dock.DOCK_SIZE[:2] == config_things.DOCK_SIZE
    assert pytest.approx(BASE_RADIUS, abs=0.005) == ROBOT_RADIUS
    assert config_things.RoverConfig(name="R", marker=1, at=(0, 0)).size == world_objects.Rover("R", 1, 0.0, 0.0).size


def test_world_is_built_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "hall.yaml"
    file.write_text(
        "world: hall\nstart: {at: [1 m, 1 m], heading: 90 deg}\nlight: [{at: 4 s, light: 50 %}]\n"
        "walls: [{from: [3 m, -1 m], to: [3 m, 1 m]}]\nedges: [{at: [-2 m, 0 m], size: [1 m, 1 m]}]\n"
        "furniture: [{name: bed, at: [2 m, -2 m], size: [2 m, 1 m, 0.5 m], colour: blue}]\n"
        "objects: [{name: sun, shape: ball, colour: yellow, at: [2 m, -2 m, 0.5 m], size: 0.2 m}]\n"
        "robots: [{name: R2, marker: 9, at: [4 m, 2 m], walk: [[4 m, 1 m]], speed: 1 m/s}]\n"
        "people: [{name: Anna, at: [2 m, 2 m], acts: [{hears: hello, say: Hi}, {at: 2 s, turn: away}]}]\n",
        encoding="utf-8",
    )
    world = build_world(load_world(file))
    assert (world.start.x, world.start.y, world.start.heading) == pytest.approx((1.0, 1.0, np.pi / 2))
    assert (world.light_at(3.9), world.light_at(4.0)) == (1.0, 0.5)
    assert world.distance(0.0, 0.0, 0.0, 0.0) == pytest.approx(2.95)
    assert not world.has_floor(-2.0, 0.0)
    assert world.furniture[0].colour == COLOURS["blue"]
    assert isinstance(world.objects[0], WorldBall)
    assert (world.objects[0].bottom, world.objects[0].size) == (0.5, 0.2)
    assert world.robots[0].solid(0.5).y == pytest.approx(1.5)
    assert [reply.text for reply in world.deliver_speech("Hello Anna", 1.0)] == ["Hi"]
    assert [who.shows_face(0.0, 0.0) for time in (1.0, 3.0) for who in world.people_at(time)] == [True, False]


def test_two_worlds_of_one_file_are_independent() -> None:
    one, other = build_world(config_of("party")), build_world(config_of("party"))
    one.deliver_speech("goodbye", 1.0)
    assert one.people_at(10.0) != other.people_at(10.0)
    assert other.utterances == ()


@pytest.mark.parametrize("name", WORLDS)
def test_the_plan_of_each_world_is_well_formed_and_names_everything(name: str) -> None:
    config = config_of(name)
    svg = plan_svg(config.name, build_world(config), config.summary)
    written = texts(svg)
    assert {config.name, config.summary, "robot", "1 m"} <= set(written)
    assert {f"{config.length:g} m", f"{config.width:g} m"} <= set(written)
    names = [each.name for each in (*config.people, *config.robots)]
    names += [each.name for each in (*config.furniture, *config.objects)]
    assert all(any(text.startswith(name) for text in written) for name in names)


def test_a_plan_keeps_the_measures_of_the_room() -> None:
    config = config_of("obstacles")
    drawn = elements(plan_svg("obstacles", build_world(config)))
    floor = next(element for element in drawn if element.get("class") == "floor")
    corners = np.array([[float(value) for value in pair.split(",")] for pair in (floor.get("points") or "").split()])
    assert np.ptp(corners, axis=0) == pytest.approx((config.length * UNITS_PER_METRE, config.width * UNITS_PER_METRE))


def test_plan_shows_the_path_of_each_person() -> None:
    world = build_world(config_of("party"))  # Emil goes to two places, Chidi to one and back
    paths = [element for element in elements(plan_svg("party", world)) if element.get("class") == "path"]
    assert len(paths) == 3
    assert plan_svg("party", world) != plan_svg("party", world, time=8.0)


def test_plan_escapes_names() -> None:
    svg = plan_svg('<b> & "c"', SimulatedWorld(start=Pose2D(0.0, 0.0, 0.0)), "<!--")
    assert {'<b> & "c"', "<!--"} <= set(texts(svg))


def test_world_description_contains_everything() -> None:
    words = "\n".join(describe_world(config_of("party")))
    assert 'on hearing "hello": says "Hello, robot!", nods' in words
    assert "after 20 s: turns away" in words
    assert "Chidi (chidi) at [3.6 m, 1.6 m]; goes to [3.6 m, -1.8 m] and back at 0.5 m/s" in words
    assert "15 % from 3 s (within 5 s)" in "\n".join(describe_world(config_of("dim")))
    assert "R2 with marker 7 at [3.2 m, 0.3 m]" in "\n".join(describe_world(config_of("objects")))


def test_dock_is_in_description_plan_and_map() -> None:
    config = config_of("square_arena")
    assert "  dock       at [-2.45 m, -1 m], facing 0 deg" in describe_world(config)
    world = build_world(config)
    drawn = plan_svg("square_arena", world)
    assert "dock" in texts(drawn)
    assert [element.tag[-4:] for element in elements(drawn) if element.get("class") == "docking"] == ["line"]
    bare = replace(world, dock=None)
    with_it, without = (topview.TopView(each, (500, 500)).draw(0.0, world.start) for each in (world, bare))
    changed = np.argwhere((with_it != without).any(axis=2))
    scale = 500 / (config.length + 0.7)
    middle = 250 + scale * -1.0 * np.array((-1.0, 2.45))  # row, column of the dock
    assert len(changed) > 100
    assert np.abs(changed - middle).max() < 0.6 * scale


def test_battery_of_a_world_is_described_and_simulated(tmp_path: Path) -> None:
    file = tmp_path / "hall.yaml"
    for text, words in (
        ("{level: 80 %, drain: 10}", "80 %, empties and fills 10 times as fast as a real one"),
        ("{level: 30 %}", "30 %"),
        ("{level: 30 %, drain: 0}", "30 %, and does not empty"),
    ):
        file.write_text(f"world: hall\nphysics: {{battery: {text}}}\n", encoding="utf-8")
        config = load_world(file)
        assert f"  battery    {words}" in describe_world(config)
        assert not any(line.startswith("  physics") for line in describe_world(config))
        battery, given = build_battery(config.physics), config.physics.battery
        assert battery is not None
        assert given is not None
        assert (battery.percent, battery.drain) == (100 * given.level, given.drain)
    assert build_battery(config_of("empty").physics) is None


def test_square_arena_has_room_and_dock_signals_at_the_start() -> None:
    world = build_world(config_of("square_arena"))
    x, y = world.start.x, world.start.y
    assert all(
        world.contact_directions(x + along * 3.0, y + across * 3.0, ROBOT_RADIUS + 0.3, 0.0) == []
        for along, across in [(share, 0.0) for share in np.linspace(0, 1, 31)]
        + [(1.0, share) for share in np.linspace(0, 1, 31)]
        + [(share, 1.0) for share in np.linspace(0, 1, 31)]
        + [(0.0, share) for share in np.linspace(0, 1, 31)]
    )
    body = BaseBody(wheels=SimulatedWheels(pose=Pose2D(x, y, np.pi)), ground=world)
    body.advance(0.0)
    assert body.dock_signals()


def test_corridor_lets_the_robot_pass_straight() -> None:
    world = build_world(config_of("corridor"))
    assert all(world.contact_directions(x, 0.0, ROBOT_RADIUS + 0.1, 0.0) == [] for x in np.linspace(0.0, 6.5, 66))
    assert world.contact_directions(2.0, 0.3, ROBOT_RADIUS, 0.0)


# mission show


def test_show_describes_a_world_without_an_output_file(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "show", "stairs")
    assert outcome.code == 0
    assert outcome.out.startswith("stairs: The floor ends")
    assert "edge       no floor: 1.2 m by 2.4 m about [2.4 m, -0.3 m]" in outcome.out
    assert outcome.out.endswith("To draw it: mission show stairs -o stairs.svg\n")


def test_show_draws_a_world_as_plan_map_and_camera_view(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    svg, png, view = (str(tmp_path / name) for name in ("plan.svg", "plan.png", "view.png"))
    assert command(capsys, "show", "party", "-o", svg).code == 0
    assert command(capsys, "show", "party", "-o", png, "--at", "6 s").code == 0
    assert command(capsys, "show", "party", "--camera", "-o", view).code == 0
    assert {"party", "robot", "1 m", "Dora"} <= set(texts(Path(svg).read_text(encoding="utf-8")))
    image, seen = cv2.imread(png), cv2.imread(view)
    assert image is not None
    assert seen is not None
    drawn = ET.fromstring(Path(svg).read_text(encoding="utf-8")).attrib  # noqa: S314 - our own drawing
    assert image.shape[:2] == pytest.approx((1.5 * float(drawn["height"]), 1.5 * float(drawn["width"])), abs=1)
    assert (image[:150, 150:400] < 128).any()  # its title
    assert seen.shape == (480, 640, 3)


def test_png_plan_without_its_extra_gives_an_install_hint(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    outcome = command(capsys, "show", "party", "-o", str(tmp_path / "party.png"))
    assert outcome.code == 2
    assert f"pip install 'missiontree[plots]', or -o {tmp_path / 'party.svg'}" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("party", "-o", "party.gif"), "must end in .svg or .png"),
        (("party", "--camera", "-o", "party.svg"), "must end in .png"),
        (("party", "--camera"), "such as -o party.png"),
        (("party", "--at", "5"), "has no unit"),
        (("party", "-o", "no/such/folder/party.svg"), "there is no folder no/such/folder\n  try: mkdir -p"),
        (("prty",), "did you mean 'party'?"),
    ],
)
def test_show_refuses_undrawable_things(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], said: str
) -> None:
    outcome = command(capsys, "show", *arguments)
    assert outcome.code == 2
    assert said in outcome.err


def test_show_reports_mistakes_in_a_world_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "hall.yaml"
    file.write_text("world: hall\npeople:\n  - {name: Anna, at: [9 m, 0 m]}\n", encoding="utf-8")
    outcome = command(capsys, "show", str(file))
    assert outcome.code == 2
    assert "hall.yaml:3:22: Anna is outside the room at [9 m, 0 m]\n" in outcome.err
    assert "  the room is x -3 m to 5 m, y -3 m to 3 m" in outcome.err


# The docs


def test_every_world_of_the_docs_can_be_built(tmp_path: Path) -> None:
    blocks = re.findall(r"^```yaml\n(.*?)^```$", DOCS.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 2
    for block in blocks:
        file = tmp_path / "docs.yaml"
        file.write_text(block, encoding="utf-8")
        config = load_world(file)
        assert len(build_world(config).people) == len(config.people) > 0


def test_the_docs_name_every_colour_every_look_and_every_world() -> None:
    text = DOCS.read_text(encoding="utf-8")
    assert all(f"`{word}`" in text for word in (*COLOURS, *APPEARANCES, *WORLDS))
