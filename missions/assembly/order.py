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
    """Yield the ``chosen`` kinds, each after those that its driver needs and those that its kind comes after."""
    made: set[str] = set()

    def make(kind: str) -> Iterator[str]:
        if kind in made or kind not in chosen or kind not in config.sections:
            return
        made.add(kind)
        for before in (*config.sections[kind].driver.needs, *KINDS[kind].after):
            yield from make(before)
        yield kind

    for kind in KINDS:
        yield from make(kind)
