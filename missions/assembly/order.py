"""In which order the parts of a robot are made, and which of them bring others along."""

from collections.abc import Iterator

from config.robot import RobotConfig
from drivers.api.kinds import KINDS


def with_carriers(config: RobotConfig, chosen: frozenset[str]) -> frozenset[str]:
    """Return the parts that a robot has of the ``chosen``, and those that carry them."""
    if "camera" in chosen:
        chosen |= {"head"}
    chosen &= config.parts
    return chosen | {need for kind in chosen for need in config.sections[kind].driver.needs if need in config.parts}


def making_order(config: RobotConfig, chosen: frozenset[str]) -> Iterator[str]:
    """Yield the ``chosen`` parts, each after those that its driver needs and those that its kind comes after."""
    made: set[str] = set()

    def make(part: str) -> Iterator[str]:
        if part in made or part not in chosen or part not in config.sections:
            return
        made.add(part)
        for before in (*config.sections[part].driver.needs, *config.kind_of(part).after):
            yield from make(before)
        yield part

    for part in (*KINDS, *sorted(config.parts.difference(KINDS))):
        yield from make(part)
