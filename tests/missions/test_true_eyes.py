"""True eyes: they see what real detectors find in rendered pictures of the same world, and no more."""

from dataclasses import replace
from math import hypot, isnan, pi, radians
from random import Random

import pytest

from config.colours import COLOURS
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import Light, LightChange, SimulatedWorld
from drivers.sim.world_objects import Rover, Wall, WorldBall, WorldBox
from missions.assembly.simulated_eyes import SensorNoise, TrueSight
from missions.assembly.truth import GroundTruth
from missions.library.interests import Interests
from perception.api import BALL, BOX, Gaze, Marker, Thing, ThingSpec
from perception.colour_spots import ThingSense
from perception.geometry import wrap_angle
from perception.markers import MarkerSense
from perception.tracks import MarkerSet
from tests.perception.rendered import CAMERA, LENS, frame

FLAWLESS = SensorNoise(missed=0.0, noise=0.0)
KIND = MarkerSet(robots={7: "R2"})
WANTED = (ThingSpec("sun", "yellow", BALL, 0.2), ThingSpec("crate", "red", BOX, 0.3), ThingSpec("blue", "blue"))
SUN = WorldBall("sun", 2.0, 0.3, 0.2, COLOURS["yellow"], bottom=0.4)
CRATE = WorldBox("crate", 2.2, -0.5, (0.3, 0.3, 0.3), COLOURS["red"], heading=0.5)
R2 = Rover("R2", 7, 1.8, 0.9, heading=pi + 0.6)
WORLD = SimulatedWorld(objects=(SUN, CRATE), robots=(R2,))
EYE = Viewpoint(z=0.7, pitch=radians(12))


def true(
    world: SimulatedWorld, view: Viewpoint = EYE, *, flaws: SensorNoise = FLAWLESS, frames: int = 2
) -> tuple[tuple[Thing, ...], tuple[Marker, ...]]:
    """What true eyes see after so many pictures."""
    sight = TrueSight(
        world,
        lambda _: view,
        lambda _: Gaze(view.yaw, view.pitch),
        CAMERA,
        noise=flaws,
        seed=1,
        on_view=lambda _: None,
        interests=Interests(WANTED, KIND, motion=True),
    )
    for number in range(frames):
        sight.see(sight.glimpse(number / 20))
    return sight.things(), sight.markers()


def real(world: SimulatedWorld, view: Viewpoint = EYE) -> tuple[tuple[Thing, ...], tuple[Marker, ...]]:
    """What detectors find in the picture of the same."""
    renderer, things, markers = Renderer(world, LENS, noise=2.0), ThingSense(WANTED, COLOURS), MarkerSense(KIND)
    gaze = Gaze(view.yaw, view.pitch)
    for number in range(2):
        picture = frame(renderer.draw(view, number / 20), number / 20)
        found = things.sense(picture, CAMERA, gaze), markers.sense(picture, CAMERA, gaze)
    return found


def test_true_sight_agrees_with_the_detectors() -> None:
    (true_things, true_markers), (real_things, real_markers) = true(WORLD), real(WORLD)
    assert {thing.name for thing in true_things} == {"sun", "crate"}
    for it in true_things:
        (same,) = [other for other in real_things if other.name == it.name]
        assert (it.colour, it.shape, it.size) == (same.colour, same.shape, same.size)
        assert it.box.overlap(same.box) > 0.75
        assert hypot(it.yaw - same.yaw, it.pitch - same.pitch) < radians(0.8)
        assert it.distance == pytest.approx(same.distance, rel=0.08)
    (marker,), (read,) = true_markers, real_markers
    assert (marker.number, marker.name) == (read.number, read.name) == (7, "R2")
    assert marker.distance == pytest.approx(read.distance, rel=0.03)
    assert marker.yaw == pytest.approx(read.yaw, abs=radians(0.6))
    assert wrap_angle(marker.heading - read.heading) == pytest.approx(0.0, abs=radians(6))


@pytest.mark.parametrize(
    "view",
    [
        replace(EYE, yaw=pi),  # behind
        replace(EYE, yaw=radians(45)),  # beyond the side
        replace(EYE, pitch=radians(-40)),  # above
        replace(EYE, x=-3.0, z=2.5, yaw=pi),  # far, and behind
    ],
)
def test_objects_out_of_view_are_not_detected(view: Viewpoint) -> None:
    (things, _), (real_things, _) = true(WORLD, view), real(WORLD, view)
    assert not [thing for thing in (*things, *real_things) if thing.name != "blue"]


def test_objects_behind_a_wall_are_not_detected() -> None:
    hidden = replace(WORLD, walls=(Wall((1.0, -1.5), (1.0, 1.5)),))
    assert true(hidden) == ((), ())


def test_too_small_or_dark_objects_are_not_detected() -> None:
    assert true(replace(WORLD, objects=(replace(SUN, size=0.02),), robots=())) == ((), ())
    assert true(replace(WORLD, light=0.02)) == ((), ())
    far = SimulatedWorld(robots=(replace(R2, x=4.8, y=0.0, heading=pi + 0.6),))
    assert true(far)[1] == ()


def test_true_sight_reports_only_requested_things() -> None:
    green = replace(SUN, colour=COLOURS["green"])
    assert true(SimulatedWorld(objects=(green, replace(SUN, y=-0.2))))[0][0].name == "sun"
    assert len(true(SimulatedWorld(objects=(green,)))[0]) == 0


def test_a_thing_of_unknown_size_has_no_distance() -> None:
    ((thing,), _) = true(SimulatedWorld(objects=(replace(SUN, colour=COLOURS["blue"]),)))
    assert thing.name == "blue"
    assert isnan(thing.distance)


def test_a_part_of_all_looks_is_missed_at_random() -> None:
    truth = GroundTruth(WORLD, CAMERA, SensorNoise(missed=0.3, noise=1.0), Random(5))  # noqa: S311 - noise is no secret
    looks = [truth.things(EYE, 0.0, WANTED, COLOURS) for _ in range(300)]
    assert 0.6 < sum(len(things) for things in looks) / 600 < 0.8
    assert len({things[0].box for things in looks if things}) > 100


def test_true_sight_reports_motion() -> None:
    walker = Person("Ben", x=2.5, y=0.6, path=((2.5, -0.6),), speed=0.8)
    for people, least, most in (((walker,), 0.002, 0.1), ((replace(walker, path=()),), 0.0, 0.0)):
        sight = TrueSight(
            SimulatedWorld(people=people),
            lambda _: Viewpoint(z=1.1),
            lambda _: None,
            CAMERA,
            noise=FLAWLESS,
            seed=1,
            on_view=lambda _: None,
            interests=Interests(motion=True),
        )
        assert sight.glimpse(0.0).scene.motion == 0.0
        motion = sight.glimpse(0.08).scene.motion
        assert motion is not None
        assert least <= motion <= most


def test_without_interests_nothing_but_faces_is_looked_for() -> None:
    world = replace(WORLD, light=Light(1.0, (LightChange(5.0, 0.2),)))
    sight = TrueSight(world, lambda _: EYE, lambda _: None, CAMERA, noise=FLAWLESS, seed=1, on_view=lambda _: None)
    for number in range(3):
        sight.see(sight.glimpse(number / 20))
    assert (sight.things(), sight.markers()) == ((), ())
    scene = sight.scene()
    assert scene is not None
    assert scene.motion is None
