"""Simulated worlds from world files."""

from config.colours import COLOURS
from config.world import PhysicsConfig, WorldConfig
from config.world_items import ActConfig, BoxConfig, PersonConfig, RoverConfig, ThingConfig, Vector3D
from drivers.api import Pose2D
from drivers.sim.battery import INTERNAL_RESISTANCE, Battery
from drivers.sim.context import Physics
from drivers.sim.people import Person
from drivers.sim.person_actions import PersonAction
from drivers.sim.room import Room
from drivers.sim.world import Light, LightChange, SimulatedWorld
from drivers.sim.world_objects import Edge, Rover, Wall, WorldBall, WorldBox, WorldDock


def build_world(config: WorldConfig) -> SimulatedWorld:
    """Return the simulated world of a world file."""
    return SimulatedWorld(
        room=Room.with_default_fixtures(config.length, config.width, config.height, config.centre),
        people=tuple(_person(person) for person in config.people),
        light=Light(
            config.light, tuple(LightChange(change.at, change.light, change.over) for change in config.light_changes)
        ),
        walls=tuple(Wall(wall.start, wall.end, wall.height or config.height) for wall in config.walls),
        furniture=tuple(_box(box, box.size) for box in config.furniture),
        edges=tuple(Edge(edge.x, edge.y, edge.length, edge.width) for edge in config.edges),
        objects=tuple(_thing(thing) for thing in config.objects),
        robots=tuple(_rover(rover) for rover in config.robots),
        dock=None if config.dock is None else WorldDock(config.dock.x, config.dock.y, config.dock.heading),
        start=Pose2D(config.start.x, config.start.y, config.start.heading),
    )


def build_physics(physics: PhysicsConfig) -> Physics:
    """Return the error model of the simulated base in a world."""
    return Physics(physics.lag, physics.slip, physics.gyro_noise, physics.dropouts, build_battery(physics))


def build_battery(physics: PhysicsConfig) -> Battery | None:
    """Return the battery of the simulated base in a world; None if the world has none."""
    battery = physics.battery
    return (
        None if battery is None else Battery(100 * battery.level, drain=battery.drain, resistance=INTERNAL_RESISTANCE)
    )


def _person(config: PersonConfig) -> Person:
    return Person(
        config.name,
        look=config.look,
        x=config.x,
        y=config.y,
        height=config.height,
        facing=config.facing,
        path=config.path,
        speed=config.speed,
        start=config.start,
        loop=config.loop,
        acts=tuple(_act(act) for act in config.acts),
        hears_within=config.hears_within,
    )


def _act(config: ActConfig) -> PersonAction:
    return PersonAction(
        at=config.at,
        hears=config.hears,
        after=config.after,
        say=config.say,
        nod=config.nod,
        turn=config.turn,
        leave=config.leave,
        times=config.times,
    )


def _thing(config: ThingConfig) -> WorldBox | WorldBall:
    if not isinstance(config.size, float):
        return _box(config, config.size)
    return WorldBall(config.name, config.x, config.y, config.size, COLOURS[config.colour], bottom=config.bottom)


def _box(config: BoxConfig | ThingConfig, size: Vector3D) -> WorldBox:
    colour = COLOURS[config.colour]
    return WorldBox(config.name, config.x, config.y, size, colour, heading=config.heading, bottom=config.bottom)


def _rover(config: RoverConfig) -> Rover:
    return Rover(
        config.name,
        config.marker,
        config.x,
        config.y,
        heading=config.heading,
        size=config.size,
        colour=COLOURS[config.colour],
        path=config.path,
        speed=config.speed,
        start=config.start,
        loop=config.loop,
    )
