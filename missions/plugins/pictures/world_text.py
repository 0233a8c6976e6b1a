"""Description of a world in text: room, objects, people and their motion."""

from collections.abc import Iterator
from dataclasses import replace

from config.units import quantity_text
from config.world import BatteryConfig, PhysicsConfig, WorldConfig
from config.world_items import ActConfig, BoxConfig, PersonConfig, RoverConfig, ThingConfig


def describe_world(world: WorldConfig) -> Iterator[str]:
    """Yield the content of a world file, one line for each object."""
    yield f"{world.name}: {world.summary}" if world.summary else world.name
    room = f"{_metres(world.length)} by {_metres(world.width)}, {_metres(world.height)} high"
    (x, y), along, across = world.centre, world.length / 2, world.width / 2
    yield _line(
        "room",
        f"{room}; x {_metres(x - along)} to {_metres(x + along)}, y {_metres(y - across)} to {_metres(y + across)}",
    )
    yield _line("start", f"{_place(world.start.x, world.start.y)}, {_degrees(world.start.heading)}")
    yield _line("light", _light(world))
    yield _line("camera", f"noise of {world.noise:g} grey levels" + _loss_text(world.dropouts, "pictures"))
    if replace(world.physics, battery=None) != PhysicsConfig():
        yield _line("physics", _physics(world.physics))
    if world.physics.battery is not None:
        yield _line("battery", _battery(world.physics.battery))
    yield from _object_lines(world)
    for person in world.people:
        yield _line("person", _person(person))
        for act in person.acts:
            yield _line("", _act(act))


def _object_lines(world: WorldConfig) -> Iterator[str]:
    """Yield lines for the objects and the edges of the floor."""
    for wall in world.walls:
        yield _line(
            "wall", f"from {_place(*wall.start)} to {_place(*wall.end)}, {_metres(wall.height or world.height)} high"
        )
    for edge in world.edges:
        yield _line("edge", f"no floor: {_metres(edge.length)} by {_metres(edge.width)} about {_place(edge.x, edge.y)}")
    for piece in world.furniture:
        yield _line("furniture", _thing(piece))
    for thing in world.objects:
        yield _line("object", _thing(thing))
    for rover in world.robots:
        yield _line("robot", f"{rover.name} with marker {rover.marker} at {_place(rover.x, rover.y)}{_walk(rover)}")
    if world.dock is not None:
        dock = world.dock
        yield _line("dock", f"at {_place(dock.x, dock.y)}, facing {quantity_text(dock.heading, 'angle')}")


def _line(label: str, text: str) -> str:
    return f"  {label:<10} {text}"


def _metres(value: float) -> str:
    return quantity_text(value, "length")


def _degrees(angle: float) -> str:
    return f"looking {quantity_text(angle, 'angle')}"


def _place(x: float, y: float) -> str:
    return f"[{_metres(x)}, {_metres(y)}]"


def _light(world: WorldConfig) -> str:
    if not world.light_changes:
        return quantity_text(world.light, "share")
    return ", ".join(
        f"{quantity_text(change.light, 'share')} from {quantity_text(change.at, 'duration')}"
        + (f" (within {quantity_text(change.over, 'duration')})" if change.over else "")
        for change in world.light_changes
    )


def _loss_text(share: float, what: str) -> str:
    return f", {quantity_text(share, 'share')} of the {what} lost" if share else ""


def _physics(physics: PhysicsConfig) -> str:
    return (
        f"wheels slip {quantity_text(physics.slip, 'share')}, lag {quantity_text(physics.lag, 'duration')}, "
        f"gyro noise {quantity_text(physics.gyro_noise, 'turn rate')}{_loss_text(physics.dropouts, 'reports')}"
    )


def _battery(battery: BatteryConfig) -> str:
    if not battery.drain:
        return f"{quantity_text(battery.level, 'share')}, and does not empty"
    pace = "" if battery.drain == 1.0 else f", empties and fills {battery.drain:g} times as fast as a real one"
    return f"{quantity_text(battery.level, 'share')}{pace}"


def _thing(thing: BoxConfig | ThingConfig) -> str:
    if isinstance(thing.size, float):
        shape = f"{thing.colour} ball, {_metres(thing.size)}"
    else:
        shape = f"{thing.colour}, {' x '.join(f'{side:g}' for side in thing.size)} m"
    above = f", {_metres(thing.bottom)} above the floor" if thing.bottom else ""
    return f"{thing.name} ({shape}) at {_place(thing.x, thing.y)}{above}"


def _walk(walker: PersonConfig | RoverConfig) -> str:
    if not walker.path:
        return ""
    stops = ", ".join(_place(*stop) for stop in walker.path)
    after = f", from {quantity_text(walker.start, 'duration')} on" if walker.start else ""
    return f"; goes to {stops}{' and back' if walker.loop else ''} at {quantity_text(walker.speed, 'speed')}{after}"


def _person(person: PersonConfig) -> str:
    facing = person.facing if isinstance(person.facing, str) else quantity_text(person.facing, "angle")
    turned = "" if facing == "camera" else f", facing {facing}"
    return f"{person.name} ({person.look}) at {_place(person.x, person.y)}{turned}{_walk(person)}"


def _act(act: ActConfig) -> str:
    does = [f'says "{act.say}"'] if act.say else []
    does += ["nods"] if act.nod else []
    if act.turn is not None:
        turn = act.turn if isinstance(act.turn, str) else f"to {quantity_text(act.turn, 'angle')}"
        does.append({"camera": "turns to the camera", "away": "turns away"}.get(str(turn), f"turns {turn}"))
    does += ["leaves"] if act.leave else []
    when = (
        f"after {quantity_text(act.at, 'duration')}"
        if act.at is not None
        else f'on hearing "{act.hears}"'
        if act.hears
        else "on hearing anything"
    )
    often = {0: "", 1: ", once"}.get(act.times, f", {act.times} times")
    return f"{when}{often}: {', '.join(does)}"
