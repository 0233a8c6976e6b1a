"""The plan of the world that a run took place in, with the way of the robot on it; none for a run in the real world."""

from base64 import b64encode

from config.faults import InvalidFileError, Source
from config.world import WorldConfig, read_world
from drivers.api import BASE_RADIUS
from missions.library.worlds import build_world
from missions.records.recording.read import Record
from missions.records.report.chart import way_in_metres
from missions.records.report.traces import Route
from missions.views.pictures.page.markup import Markup, join, start, tag
from missions.views.pictures.plan import METRE, frame_of, plan

WORLDS = "world/"
"""What the names of world files in a record begin with."""


def world_of(record: Record) -> WorldConfig | None:
    """Return the world that a record was made in; None where it has none that can be read."""
    found = []
    for name, data in record.files.items():
        if name.startswith(WORLDS):
            try:
                found.append(read_world(Source(name, data.decode("utf-8-sig"))))
            except (InvalidFileError, UnicodeDecodeError):
                continue
    named = [world for world in found if world.name == record.head.world]
    return next(iter(named or found), None) if record.head.simulate else None


def floor(record: Record, route: Route) -> Markup:
    """Return the plan, as the world was at the beginning; the script moves ``.robot`` along the way on it."""
    config = world_of(record)
    if config is None:
        return join()
    world = build_world(config)
    frame = frame_of(world)
    picture = b64encode(plan(config.name, world, config.summary).encode()).decode()
    drawn = start("img", src=f"data:image/svg+xml;base64,{picture}", alt=f"Plan of the world {config.name}")
    if route.places:
        # The way is drawn as it is without a plan, ahead being up: here ahead is where the robot looked at first.
        put = f"translate({frame.x:g} {frame.y:g}) rotate({90 - frame.heading:.3f}) scale({METRE})"
        way = tag("g", way_in_metres(route, BASE_RADIUS), transform=put)
        label = f"The way of the base, {route.length:.1f} m long"
        size = f"0 0 {frame.width:g} {frame.height:g}"
        drawn = join(drawn, tag("svg", way, viewBox=size, class_="on-plan", role="img", aria_label=label))
    return tag("div", drawn, class_="plan card")
