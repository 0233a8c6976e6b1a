"""The simulated world: a room, the people in it, and the light. A pure value; time is asked for, never kept."""

from collections import Counter
from dataclasses import dataclass, field

from drivers.errors import BadRequest
from drivers.sim.people import Person, Presence
from drivers.sim.room import Room


@dataclass(frozen=True, slots=True)
class World:
    """Everything that a simulated camera can see.

    ``light`` scales the brightness of the picture: 1 is daylight, 0.25 a quarter of it.
    Raises BadRequest when a person's place or path leaves the room, two people share a name, or ``light`` is negative.
    """

    room: Room = field(default_factory=Room)
    people: tuple[Person, ...] = ()
    light: float = 1.0

    def __post_init__(self) -> None:
        if self.light < 0:
            raise BadRequest(f"world: light {self.light}: must not be negative")
        twice = [name for name, count in Counter(person.name for person in self.people).items() if count > 1]
        if twice:
            raise BadRequest(f"world: more than one person is called {', '.join(twice)}")
        (x_low, x_high), (y_low, y_high) = self.room.extent()
        for person in self.people:
            for x, y in ((person.x, person.y), *person.path):
                if not self.room.inside(x, y):
                    raise BadRequest(
                        f"world: {person.name} at ({x:g}, {y:g}) m is outside the room",
                        hint=f"the room is x {x_low:g}..{x_high:g} m, y {y_low:g}..{y_high:g} m",
                    )

    def people_at(self, time: float) -> tuple[Presence, ...]:
        """Return where everybody is at ``time`` seconds, in the order of ``people``."""
        return tuple(Presence(person, *person.place(time)) for person in self.people)
