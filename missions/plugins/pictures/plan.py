"""Plan of a world as SVG: the room with its dimensions, objects, people and their paths.

x points right and y up, as on the robot's map; one metre is ``UNITS_PER_METRE`` units of the drawing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, cos, degrees, sin
from xml.etree import ElementTree as ET

from drivers.api import BASE_RADIUS
from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import BODY_RADIUS, FloorPosition, Presence
from drivers.sim.room import Colour
from drivers.sim.solids import UprightBox
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import Rover, WorldBall, WorldBox

UNITS_PER_METRE = 100
"""Drawing units per metre."""

_STYLE = """
text { font: 15px "DejaVu Sans", sans-serif; fill: #33353a; text-anchor: middle; paint-order: stroke;
       stroke: #fdfcf8; stroke-width: 4px; stroke-linejoin: round }
.on { stroke: none } .light { fill: #f6f6f2 } .title { font-size: 24px; font-weight: bold; text-anchor: start }
.summary { font-size: 16px; text-anchor: start; fill: #5a5d64 }
.measure { fill: #6b6e76; stroke: white; stroke-width: 12px }
.floor { fill: #fdfcf8 } .outside { fill: none; stroke: #4a4744; stroke-width: 9 }
.grid { stroke: #e7e3d8; stroke-width: 1 }
.wall { fill: #4a4744 } .hole { fill: url(#steps); stroke: #343238 } .thing { stroke: #34363c; stroke-width: 1.5 }
.path { fill: none; stroke: #a2543a; stroke-width: 2; stroke-dasharray: 8 6; marker-end: url(#arrow) }
.line { stroke: #6b6e76; stroke-width: 1.5 } .both { marker-start: url(#end); marker-end: url(#end) }
.docking { stroke: #2e8c4a; stroke-width: 5; stroke-linecap: round }
.robot { fill: #2660b4; stroke: #14325f } .nose { stroke: white; stroke-width: 4; stroke-linecap: round }
.paper { fill: #ffffff }
@media (prefers-color-scheme: dark) {
text { fill: #e5e9ee; stroke: #20262e } .on { fill: #33353a } .paper { fill: #1b2128 } .summary { fill: #a3aeba }
.measure { fill: #a3aeba; stroke: #1b2128 } .floor { fill: #20262e } .outside { stroke: #a3aeba }
.grid { stroke: #343d48 } .wall { fill: #a3aeba } .path { stroke: #e08a66 } .line { stroke: #a3aeba }
}
"""

_DEFINITIONS = """<defs>
<marker id="arrow" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="12" markerHeight="12"
 markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0 10 5 0 10z" fill="#a2543a"/></marker>
<marker id="end" viewBox="-5 -5 10 10" markerWidth="10" markerHeight="10" markerUnits="userSpaceOnUse" orient="auto">
<path d="M0 -5V5" stroke="#6b6e76" stroke-width="1.5"/></marker>
<pattern id="steps" width="18" height="18" patternUnits="userSpaceOnUse"><rect width="18" height="18" fill="#3a383e"/>
<path d="M9 0V18" stroke="#6f6c76" stroke-width="2"/></pattern>
</defs>"""


@dataclass(frozen=True, slots=True)
class PlanFrame:
    """Size of the drawing of a world, and the robot's start position and heading (degrees) in it."""

    width: float
    height: float
    x: float
    y: float
    heading: float


def plan_frame(world: SimulatedWorld) -> PlanFrame:
    """Return the size of the plan of ``world``, and the position and heading of the robot's start in it."""
    drawn = _PlanDrawing(world, 0.0)
    start = world.start
    return PlanFrame(drawn.width, drawn.height, *drawn.to_drawing((start.x, start.y)), degrees(start.heading))


def plan_svg(name: str, world: SimulatedWorld, summary: str = "", time: float = 0.0) -> str:
    """Return an SVG document of ``world`` at ``time`` seconds."""
    return _PlanDrawing(world, time).document(name, summary)


class _PlanDrawing:
    """Drawing of one plan. Positions are in metres."""

    def __init__(self, world: SimulatedWorld, time: float) -> None:
        self._world = world
        self._time = time
        room = world.room
        self._left, self._top, self._bottom = 90, 100, 90  # margins in units: dimensions, title, scale
        self.width = room.length * UNITS_PER_METRE + 2 * self._left
        self.height = room.width * UNITS_PER_METRE + self._top + self._bottom
        size = {
            "viewBox": f"0 0 {self.width:g} {self.height:g}",
            "width": f"{self.width:g}",
            "height": f"{self.height:g}",
        }
        self._svg = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", **size})

    def document(self, name: str, summary: str) -> str:
        """Return the complete plan as the text of an SVG document."""
        self._add("title").text = name
        self._add("style").text = _STYLE
        self._add("defs")
        self._add("rect", width="100%", height="100%", **{"class": "paper"})
        self._add("text", x=self._left, y=42, **{"class": "title"}).text = name
        self._add("text", x=self._left, y=68, **{"class": "summary"}).text = summary
        self._room()
        for thing in sorted((*self._world.furniture, *self._world.things), key=lambda it: it.solid().top):
            self._thing(thing)
        if self._world.dock is not None:
            self._line(*self._world.dock.approach_line, "docking")
        for rover in self._world.robots:
            self._rover(rover)
        for presence in self._world.people_at(self._time):
            self._person(presence)
        self._start()
        self._measures()
        ET.indent(self._svg)
        return ET.tostring(self._svg, encoding="unicode").replace("<defs />", _DEFINITIONS) + "\n"

    def _room(self) -> None:
        room = self._world.room
        (x_low, x_high), (y_low, y_high) = room.extent()
        corners = UprightBox(*room.centre, room.length, room.width).corners()
        self._polygon(corners, "floor")
        for x in range(ceil(x_low + 0.01), ceil(x_high)):
            self._line((x, y_low), (x, y_high), "grid")
        for y in range(ceil(y_low + 0.01), ceil(y_high)):
            self._line((x_low, y), (x_high, y), "grid")
        self._polygon(corners, "outside")
        for edge in self._world.edges:
            self._polygon(UprightBox(edge.x, edge.y, edge.length, edge.width).corners(), "hole")
            self._text("edge", (edge.x, edge.y), "on light")
        for wall in self._world.walls:
            self._polygon(wall.solid().corners(), "wall")

    def _thing(self, thing: WorldBox | WorldBall) -> None:
        solid = thing.solid()
        if isinstance(solid, UprightBox):
            self._polygon(solid.corners(), "thing", thing.colour)
            lowest = min(y for _, y in solid.corners())
        else:
            self._disc((solid.x, solid.y), solid.radius, "thing", thing.colour)
            lowest = solid.y - solid.radius
        half = len(thing.name) * 0.045  # approximate half width of the name in metres
        if solid.nearest_offset(solid.x + half, solid.y) == solid.nearest_offset(solid.x - half, solid.y) == (0.0, 0.0):
            self._text(thing.name, (solid.x, solid.y), "on" if sum(thing.colour) > 330 else "on light")
        else:
            self._text(thing.name, (solid.x, lowest - 0.12))

    def _rover(self, rover: Rover) -> None:
        solid = rover.solid(self._time)
        self._path(rover.walk.waypoints)
        self._polygon(solid.corners(), "thing", rover.colour)
        self._nose((solid.x, solid.y), solid.heading, solid.length / 2)
        self._text(f"{rover.name}, marker {rover.marker}", (solid.x, solid.y + solid.bounding_radius + 0.1))

    def _person(self, presence: Presence) -> None:
        look, here = APPEARANCES[presence.person.look], (presence.x, presence.y)
        start = self._world.start
        way = presence.direction(start.x, start.y)
        self._path(presence.person.walk.waypoints)
        self._disc(here, BODY_RADIUS, "thing", look.shirt)
        self._disc((here[0] + 0.13 * cos(way), here[1] + 0.13 * sin(way)), 0.05, "", look.skin)
        self._disc(here, 0.12, "", look.skin if look.hair == "bald" else look.hair_colour)
        self._text(presence.person.name, (here[0], here[1] + BODY_RADIUS + 0.12))

    def _start(self) -> None:
        start = self._world.start
        self._disc((start.x, start.y), BASE_RADIUS, "robot")
        self._nose((start.x, start.y), start.heading, BASE_RADIUS * 0.8)
        self._text("robot", (start.x, start.y - BASE_RADIUS - 0.12))

    def _measures(self) -> None:
        """Draw the lengths of two walls, the coordinates of two corners, and a scale of one metre."""
        (x_low, x_high), (y_low, y_high) = self._world.room.extent()
        low, left = y_low - 0.22, x_low - 0.22
        self._line((x_low, low), (x_high, low), "line both")
        self._text(f"{x_high - x_low:g} m", ((x_low + x_high) / 2, low), "measure")
        self._line((left, y_low), (left, y_high), "line both")
        x, y = self.to_drawing((left, (y_low + y_high) / 2))
        turned = {"class": "measure", "transform": f"rotate(-90 {x:g} {y:g})"}
        self._add("text", x=x, y=y + 5, **turned).text = f"{y_high - y_low:g} m"
        for x_end, y_end in ((x_low, y_low), (x_high, y_high)):
            beside = (x_end + (0.55 if x_end == x_low else -0.55), y_end + (0.15 if y_end == y_low else -0.15))
            self._text(f"({x_end:g}, {y_end:g}) m", beside)
        below, right = y_low - 0.6, x_low + 1.0
        self._line((x_low, below), (right, below), "line both")
        self._text("1 m", ((x_low + right) / 2, below - 0.14), "measure")

    # --- shapes, in metres --------------------------------------------------------------------------------------------

    def to_drawing(self, place: FloorPosition) -> tuple[float, float]:
        """Return a position in drawing units."""
        (x_low, _), (_, y_high) = self._world.room.extent()
        return self._left + (place[0] - x_low) * UNITS_PER_METRE, self._top + (y_high - place[1]) * UNITS_PER_METRE

    def _add(self, tag: str, **attributes: object) -> ET.Element:
        shown = {key: f"{value:.5g}" if isinstance(value, float) else str(value) for key, value in attributes.items()}
        return ET.SubElement(self._svg, tag, shown)

    def _polygon(self, corners: Sequence[FloorPosition], kind: str, colour: Colour | None = None) -> None:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self.to_drawing, corners))
        fill = {} if colour is None else {"fill": _hex(colour)}
        self._add("polygon", points=points, **{"class": kind}, **fill)

    def _disc(self, place: FloorPosition, radius: float, kind: str, colour: Colour | None = None) -> None:
        x, y = self.to_drawing(place)
        fill = {} if colour is None else {"fill": _hex(colour)}
        self._add("circle", cx=x, cy=y, r=radius * UNITS_PER_METRE, **{"class": kind}, **fill)

    def _line(self, start: FloorPosition, end: FloorPosition, kind: str) -> None:
        (x1, y1), (x2, y2) = self.to_drawing(start), self.to_drawing(end)
        self._add("line", x1=x1, y1=y1, x2=x2, y2=y2, **{"class": kind})

    def _nose(self, place: FloorPosition, heading: float, length: float) -> None:
        self._line(place, (place[0] + length * cos(heading), place[1] + length * sin(heading)), "nose")

    def _path(self, stops: Sequence[FloorPosition]) -> None:
        """Draw a path with an arrow at the end of each leg; a leg walked both ways is drawn once."""
        drawn: set[tuple[FloorPosition, FloorPosition]] = set()
        for start, end in pairwise(stops):
            if not {(start, end), (end, start)} & drawn:
                self._line(start, end, "path")
            drawn.add((start, end))

    def _text(self, text: str, middle: FloorPosition, kind: str = "") -> None:
        x, y = self.to_drawing(middle)
        self._add("text", x=x, y=y + 5, **{"class": kind}).text = text


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{value:02x}" for value in colour)
