"""Drivers of MissionTree and of other distributions, and robot files that use them.

A distribution offers drivers by entry points of the group ``missiontree.drivers``: the entry point ``base.rover`` is a
driver of bases named ``rover``, and refers to a ``drivers.api.driver.Driver``. Entry points are loaded only if a robot
file names a driver that MissionTree does not have, or if all drivers are listed, so a broken one does not affect other
robots.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from inspect import get_annotations
from pathlib import Path
from typing import TYPE_CHECKING

from config import robot
from config.diagnostics import SourceText
from config.library import DEFAULT_ROBOT, find_file
from config.robot import RobotConfig
from drivers.api.driver import BrokenDriver, Driver, resolve_name
from drivers.api.keys import declared_keys
from drivers.api.kinds import KINDS
from drivers.api.sections import ArmKeys
from drivers.table import BUILT_IN_DRIVERS
from missions.library.import_trial import (
    BrokenEntryPointError,
    describe_entry_point,
    entry_points_of,
    error_text,
    load_entry_point,
    owner_of,
    short_repr,
)

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINT_GROUP = "missiontree.drivers"
"""Group of entry points by which distributions offer drivers."""


class DriverTable:
    """All drivers by kind and name; implements ``drivers.api.driver.DriverCatalogue``."""

    @cached_property
    def _entry_points(self) -> Mapping[str, Sequence["EntryPoint"]]:
        """Entry points of other distributions by name, such as ``base.rover``."""
        found: dict[str, list[EntryPoint]] = {}
        for point in entry_points_of(ENTRY_POINT_GROUP):
            found.setdefault(point.name, []).append(point)
        return found

    def names(self, kind: str) -> Sequence[str]:
        """Return the names of the drivers of a kind, those of MissionTree first."""
        others = (name.partition(".") for name in self._entry_points)
        return list(
            dict.fromkeys([*BUILT_IN_DRIVERS.get(kind, ()), *(name for of, _, name in others if of == kind and name)])
        )

    def find(self, kind: str, name: str) -> Driver:
        """Return a driver. Raises BrokenDriver for an invalid declaration, KeyError for an unknown name."""
        ours = BUILT_IN_DRIVERS.get(kind, {}).get(name)
        if ours is not None:
            found = resolve_name(ours)
            if not isinstance(found, Driver):
                raise BrokenDriver(f"{ours} is not an instance of drivers.api.Driver")
            return found
        return _load_driver(self._entry_points[f"{kind}.{name}"])

    def origin(self, kind: str, name: str) -> str:
        """Return the distribution of a driver; empty for those of MissionTree."""
        points = () if name in BUILT_IN_DRIVERS.get(kind, ()) else self._entry_points.get(f"{kind}.{name}", ())
        return ", ".join(owner_of(point) for point in points)

    def iter_drivers(self) -> Iterator[tuple[str, str, Driver | BrokenDriver]]:
        """Yield kind, name and declaration of each driver, or its error."""
        for kind in KINDS:
            for name in self.names(kind):
                try:
                    yield kind, name, self.find(kind, name)
                except BrokenDriver as error:
                    yield kind, name, error
        for name, points in self._entry_points.items():
            kind, _, driver_name = name.partition(".")
            if kind not in KINDS or not driver_name:
                kinds = ", ".join(KINDS)
                hint = f"it must be called KIND.NAME, such as base.{driver_name or kind}; kinds are: {kinds}"
                yield kind, driver_name, BrokenDriver(f"{describe_entry_point(points[0])} has an invalid name: {hint}")
            elif driver_name in BUILT_IN_DRIVERS.get(kind, ()):
                why = f"is not used: MissionTree has a {kind}.{driver_name} itself"
                yield kind, driver_name, BrokenDriver(f"{describe_entry_point(points[0])} {why}")


def _load_driver(points: Sequence["EntryPoint"]) -> Driver:
    """Return the driver of an entry point. Raises BrokenDriver."""
    point, *others = points
    description = describe_entry_point(point)
    if others:
        raise BrokenDriver(
            f"{' and '.join(map(describe_entry_point, points))} declare drivers of the same name: uninstall one "
            f"(pip uninstall {owner_of(others[-1]) or 'PACKAGE'})"
        )
    try:
        found = load_entry_point(point)
    except BrokenEntryPointError as error:
        raise BrokenDriver(f"{description} {error}") from error
    if not issubclass(type(found), Driver):
        raise BrokenDriver(f"{description} is {short_repr(found)}, not a drivers.api.driver.Driver")
    try:
        problem = _find_problem(point.name, found)
    except Exception as error:
        problem = f"cannot be examined: {error_text(error)}"
    if problem:
        raise BrokenDriver(f"{description} {problem}")
    declared_by: Driver = found
    return declared_by


def _find_problem(name: str, driver: Driver) -> str:
    """Return the error in the declaration of a driver; empty if it is valid."""
    if name != f"{driver.kind}.{driver.name}":
        return f"declares the driver {driver.kind}.{driver.name}: both must have one name"
    kind = KINDS[driver.kind]
    declares: object = driver.keys
    if not isinstance(declares, type) or not issubclass(declares, kind.keys):
        return f"has keys that do not extend {kind.keys.__module__}.{kind.keys.__name__}"
    if missing := [need for need in driver.needs if need not in KINDS]:
        return f"needs unknown parts: {', '.join(missing)}"
    try:
        declared_keys(driver.keys)
    except (TypeError, NameError) as error:
        return f"has an invalid key: {error}"
    name = driver.keys.__name__
    if "__dataclass_fields__" not in vars(driver.keys) and get_annotations(driver.keys):
        return f"has keys that are not read: write @keys before class {name}"
    if issubclass(driver.keys, ArmKeys) and driver.keys.limits is ArmKeys.limits:
        hint = "a property that returns a drivers.api.joints.JointLimits for each joint, by its name"
        return f"has keys without joints: give {name} `limits`, {hint}"
    return ""


def load_named_robot(name: str | None, ros2_domain: int | None = None) -> RobotConfig:
    """Read the file of a robot by name or path, or of the default robot, optionally with another ROS 2 domain.

    Raises InvalidFileError or UnknownNameError.
    """
    found = load_robot(find_file("robots", name or DEFAULT_ROBOT))
    if ros2_domain is None or "ros2" not in found.sections:
        return found
    return found.with_keys("ros2", replace(found.sections["ros2"].keys, domain=ros2_domain))


def load_robot(path: Path, drivers: DriverTable | None = None) -> RobotConfig:
    """Read a robot file. Raises InvalidFileError with all errors in it."""
    return robot.load_robot(path, drivers or DriverTable())


def parse_robot(source: SourceText, path: Path | None = None) -> RobotConfig:
    """Read the text of a robot file. Raises InvalidFileError."""
    return robot.parse_robot(source, DriverTable(), path)
