"""Two people who walk past each other before the camera: who is who afterwards?

``python -m tests.benchmarks.crossing`` renders fifty such meetings and tells in how many both keep their ids.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from perception.api import Face, Image
from perception.face_finder import FaceFinder
from perception.geometry import Pinhole
from perception.haar_faces import HaarFaceDetector
from perception.senses import FaceSense
from perception.tracks import Tracker

CROSSINGS = 50
RATE = 20.0
"""Pictures a second."""

TRUE_WITHIN = math.radians(5)
"""How far from a person's true direction a face may be that is theirs."""


@dataclass(frozen=True)
class Frame:
    """One picture."""

    image: Image
    stamp: float


@dataclass(frozen=True)
class Crossing:
    """Two people, the view of them, and how long it takes both to get to where the other came from."""

    world: SimulatedWorld
    view: Viewpoint
    seconds: float
    seed: int


def crossing(seed: int) -> Crossing:
    """Return two people who cross, drawn from ``seed``: their looks, heights, distances and speeds."""
    chance = Random(seed)  # noqa: S311 - chance, not a secret
    looks = chance.sample(sorted(APPEARANCES), 2)
    near = chance.uniform(1.2, 1.8)
    places = [near, near + chance.uniform(0.5, 1.0)]
    chance.shuffle(places)
    side = chance.choice((1, -1))
    people, seconds = [], 0.0
    for name, look, x, sign in zip(("A", "B"), looks, places, (side, -side), strict=True):
        y, speed = sign * 0.4 * x, chance.uniform(0.3, 0.8)
        height = chance.uniform(1.5, 1.75)
        people.append(
            Person(name, look=look, x=x, y=y, height=height, path=((x, -y),), speed=speed, start=0.6, loop=False)
        )
        seconds = max(seconds, 0.6 + 2 * abs(y) / speed + 0.6)
    view = Viewpoint(z=1.1, pitch=-math.radians(chance.uniform(10, 16)))
    return Crossing(SimulatedWorld(people=tuple(people)), view, seconds, seed)


def kept(scene: Crossing) -> bool:
    """Whether both have the id at the end that they had at the beginning."""
    lens, camera = Lens(640, 480, math.radians(60)), Pinhole(640, 480, math.radians(60))
    renderer = Renderer(scene.world, lens, seed=scene.seed)
    sense = FaceSense(FaceFinder(HaarFaceDetector()), Tracker())
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    for number in range(int(scene.seconds * RATE)):
        time = number / RATE
        faces = sense.sense(Frame(renderer.draw(scene.view, time), time), camera, None)
        for name, face in _owned(faces, scene, time):
            first.setdefault(name, face.id)
            last[name] = face.id
    return len(first) == 2 and first["A"] != first["B"] and first == last


def _owned(faces: tuple[Face, ...], scene: Crossing, time: float) -> Iterator[tuple[str, Face]]:
    """Yield the fresh face nearest to where each person truly is, while both are well apart."""
    bearings = {who.person.name: math.atan2(who.y, who.x) for who in scene.world.people_at(time)}
    if abs(bearings["A"] - bearings["B"]) < 2 * TRUE_WITHIN:
        return
    for name, bearing in bearings.items():
        fresh = [face for face in faces if face.stamp == time and abs(face.bearing - bearing) < TRUE_WITHIN]
        if fresh:
            yield name, min(fresh, key=lambda face: abs(face.bearing - bearing))


def main() -> None:
    """Print the figure, and the seeds that failed."""
    lost = [seed for seed in range(CROSSINGS) if not kept(crossing(seed))]
    print(f"{CROSSINGS - len(lost)} of {CROSSINGS} crossings keep both ids; not those of the seeds {lost}")


if __name__ == "__main__":
    main()
